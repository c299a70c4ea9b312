"""Reading a recording, complete or cut off."""

from __future__ import annotations

import html
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..board.gap import Gap
from ..clock import LAST_SAMPLE_US, DeviceClock
from ..core.bands import bands_of
from ..errors import InputError, RecordingError
from ..keep.calibration import own_settings
from ..wire import messages_gen as wire
from ..wire.batches import StreamDecoder
from ..wire.dtypes_gen import DTYPES
from ..wire.frames import BANDS_DTYPE, StructArray, bands_from_wire, frames_from_wire
from ..wire.framing import FramingCounts
from ..wire.messages_gen import Setting
from . import labels as labels_module
from . import layout
from .block import FRAME, IDLE, PAC, ROWS, Packet, as_sent
from .blocks import Block, Blocks, lost_between
from .facts import Facts
from .index import Index
from .labels import Label
from .layout import finger_of
from .selection import fields_named, part_of
from .stamps import Stamps, unwrapped_us
from .summary import lines, summary
from .tabular import Selection


class Recording:
    """A recording in memory.

    ``frames`` (FRAME_DTYPE), ``pac`` (PAC_DTYPE) and the heartbeats ``idle`` (IDLE_DTYPE) are arrays in order of
    arrival. ``wire`` holds the FRAME messages as sent, ``seq`` and ``t_us`` (int64, (n,)) their unwrapped sequence
    numbers and times, ``messages`` everything else (tare changes, status).

    ``settings`` are the board's when the recording began; ``calibrations`` and ``maps`` (bytes, as the board holds
    them) are those in force then, by finger. ``names`` maps names to fingers: ``recording["index"]`` returns that
    finger's frames.

    ``problems`` lists in words what is missing or damaged; the rest is good. ``cut_off``: the file ends without its
    index. ``damaged_chunks``: number of seconds left out. ``wrong_checksums``: number of wrong checksums over the
    file's records and its index. ``gaps``: times when the board was away.

    ``blocks`` are the wire bytes, about one block per second. ``arrived_ns`` is when each block began,
    ``all_here_ns`` when it was complete (None where unknown), both in ns on the host's clock (Unix).

    Of a complete file, opening reads the metadata, and ``select`` only what it returns; the first use of anything else
    reads and checks all of it. With ``show``, which is called with the share of that work done (0 to 1), it is read at
    once. Raises RecordingError when nothing can be read, or when the file has changed since it was opened.
    """

    problems: list[str]
    cut_off: bool
    damaged_chunks: int
    wrong_checksums: int
    arrived_ns: list[int]
    all_here_ns: list[int | None]
    messages: list[Any]
    pac: StructArray
    idle: StructArray
    seq: NDArray[np.int64]
    t_us: NDArray[np.int64]
    counts: FramingCounts
    pac_lost: int
    disordered: int
    frames_lost: int
    gaps: list[Gap]
    _blocks: list[Block]
    _sent: StructArray
    _gaps: list[list[Gap]]

    def __init__(self, path: str | os.PathLike[str], show: Callable[[float], None] | None = None) -> None:
        self.path = Path(path)
        self._index = None if show else Index.read(self.path)
        if self._index is not None:
            blocks = Blocks(self.path, {}, (), index=self._index)
            list(blocks)
            if blocks.metadata is not None and not blocks.scan.problems:
                self._take_metadata(blocks.metadata)
                return
        self._read_all(show or (lambda share: None))

    def __getattr__(self, name: str) -> Any:
        if name not in Recording.__annotations__ or "_sent" in vars(self):
            raise AttributeError(f"a Recording has no {name!r}")
        self._read_all(lambda share: None)
        return vars(self)[name]

    def _read_all(self, show: Callable[[float], None]) -> None:
        if self._index is not None:
            self._index.check(self.path)
        blocks = Blocks(self.path)
        own: list[Block] = []
        for block in blocks:
            own.append(block)
            show(blocks.scan.share)
        self.problems = blocks.scan.problems
        self.cut_off = blocks.scan.cut_off
        self.damaged_chunks = blocks.scan.damaged_chunks
        self.wrong_checksums = blocks.scan.wrong_checksums
        if blocks.metadata is None:
            raise RecordingError(self._without_metadata(blocks.damaged_metadata > 0))
        self._take_metadata(blocks.metadata)
        self._blocks = own
        self.arrived_ns = [block.arrived_ns for block in own]
        # Imported recordings store the first time for both.
        self.all_here_ns = [block.all_here_ns if block.all_here_ns != block.arrived_ns else None for block in own]
        decoder = StreamDecoder()
        decoder.accept_newer_minor()
        self.messages = decoder.feed(b"".join(block.rest.packets for block in own)).messages
        sent, self.pac, self.idle = (self._rows_of(kind) for kind in (FRAME, PAC, IDLE))
        self.seq, self.t_us = sent["seq"].astype(np.int64), sent["t_us"]
        rows = len(sent) + len(self.pac) + len(self.idle)
        self.counts = replace(decoder.counts, good=decoder.counts.good + rows)
        rests = [block.rest for block in own]
        self.pac_lost = sum(rest.lost_pac for rest in rests)
        self.disordered = sum(rest.disordered for rest in rests)
        self._gaps = [[gap for facts in rest.gaps if (gap := self._gap(facts)) is not None] for rest in rests]
        self.gaps = [gap for before_block in self._gaps for gap in before_block]
        in_damaged = sum(block.missing for block in own) + lost_between(own)
        self.frames_lost = sum(frames for rest in rests for _, _, frames in rest.lost) + in_damaged
        if self.cut_off and not len(self.seq):
            raise RecordingError(f"{self.path} was cut off before its first second was complete; record it again")
        self._sent = sent
        self.problems += self._later_labels[1]
        self._describe_losses([loss for rest in rests for loss in rest.lost], in_damaged)

    def _rows_of(self, kind: int) -> StructArray:
        return np.concatenate([np.empty(0, ROWS[kind]), *(block.rows[kind] for block in self._blocks)])

    def packets(self, from_us: int = 0) -> Iterator[tuple[int, Packet]]:
        """Messages in order of arrival, each with its block's number; without blocks that end before ``from_us``."""
        for k, block in enumerate(self._blocks):
            for packet in block.packets() if from_us <= (block.rest.last_us or from_us) else ():
                yield k, packet

    def gaps_before(self, block: int) -> list[Gap]:
        """Those between this block, by its number in ``blocks``, and the one before it."""
        return self._gaps[block]

    @cached_property
    def frames(self) -> StructArray:
        """The FRAMEs in user units, FRAME_DTYPE (n,), in order of arrival."""
        return frames_from_wire(self._sent, self.seq, self.t_us)

    @cached_property
    def wire(self) -> StructArray:
        """The FRAME messages as sent, with seq and t_us wrapped."""
        return as_sent(self._sent, FRAME)

    @cached_property
    def bands(self) -> StructArray:
        """Energy of PAC per octave, BANDS_DTYPE (n,), finger by finger: as recorded, or else computed from ``pac``."""
        recorded = [message for message in self.messages if isinstance(message, wire.Bands)]
        parts = [np.empty(0, BANDS_DTYPE)]
        for finger in sorted({m.finger for m in recorded} | set(np.unique(self.pac["finger"]).tolist())):
            sent = np.frombuffer(b"".join(m.pack() for m in recorded if m.finger == finger), DTYPES[wire.Bands.ID])
            if len(sent):
                seq = np.unwrap(sent["seq"].astype(np.int64), period=2**16)
                parts.append(bands_from_wire(sent, seq, unwrapped_us(self.begin_us, sent["t_us"])))
            else:
                parts.append(bands_of(self.pac[self.pac["finger"] == finger]))
        return np.concatenate(parts)

    @cached_property
    def blocks(self) -> list[bytes]:
        """The wire bytes as they came, about one second per block."""
        return [b"".join(packet.data for packet in block.packets()) for block in self._blocks]

    def select(
        self,
        *,
        fingers: Iterable[int | str] | None = None,
        start_s: float = 0.0,
        stop_s: float | None = None,
        fields: Iterable[str] | None = None,
        labels: str | Iterable[str] | None = None,
    ) -> Selection:
        """A part of the frames, for NumPy, pandas or xarray, to be resampled, or aligned with another sensor's signal.

        ``fingers`` are chip selects or recorded names. ``start_s`` (inclusive) and ``stop_s`` (exclusive) are device
        seconds since the first row. ``fields`` are columns of FRAME_DTYPE; ``finger``, ``seq`` and ``t_us`` come with
        them. ``labels`` are texts: only rows in their spans, or within half a second of their points. Raises InputError
        for an unknown field, finger or label. What is damaged or missing is left out; ``problems`` says so.
        """
        names = (
            None if fields is None else {"finger", "seq", "t_us", *([fields] if isinstance(fields, str) else fields)}
        )
        chosen = fields_named(names)
        spans = [(start_s, stop_s)]
        if labels is not None:
            found = labels_module.spans_us(self.labels, labels)
            times_s = [((begin - self.begin_us) / 1e6, (end + 1 - self.begin_us) / 1e6) for begin, end in found]
            spans = [(max(start_s, a), b if stop_s is None else min(stop_s, b)) for a, b in times_s]
        rows = np.concatenate([part_of(self.path, self._index, chosen, fingers, *span)[0] for span in spans])
        by_number = {finger: name for name, finger in self.names.items()}

        def label_of(rows: StructArray) -> NDArray[np.str_]:
            return labels_module.of_rows(self.labels, rows["t_us"], rows["finger"])

        return Selection(rows, tuple(chosen), by_number, label_of, self.stamp_ns)

    @cached_property
    def labels(self) -> list[Label]:
        """Labels in order of time, those about the whole recording first: made live, and with ``mark`` afterwards."""
        live = []
        for facts in (facts for block in self.heads() for facts in block.rest.labels):
            with suppress(TypeError, AttributeError, InputError):  # a damaged one
                live.append(Label(**facts))
        return labels_module.in_order([*live, *self._later_labels[0]])

    @cached_property
    def _later_labels(self) -> tuple[list[Label], list[str]]:
        return labels_module.read(self.path, self.begin_ns)

    def mark(
        self,
        text: str,
        at_s: float | None = None,
        until_s: float | None = None,
        *,
        finger: int | str | None = None,
        **facts: str | float,
    ) -> None:
        """Add a label, in a file beside the recording: the recording itself is not touched.

        ``at_s`` and ``until_s`` are device seconds since the first row; without them the label is about all of it. See
        Label for the rest. Raises InputError where that cannot be written, KeyError for an unknown finger.
        """
        t_us, end_us = (None if s is None else self.begin_us + round(s * 1e6) for s in (at_s, until_s))
        number = None if finger is None else finger_of(finger, self.names)
        labels_module.append(self.path, self.begin_ns, Label(text, t_us, end_us, number, facts))
        for name in ("labels", "_later_labels"):
            vars(self).pop(name, None)

    def __repr__(self) -> str:
        facts = summary(self)
        return f"<biotac.Recording {lines(facts)[0]}, fingers {list(facts['fingers'])}, {len(self.labels)} label(s)>"

    def _repr_html_(self) -> str:
        return "<br>".join(html.escape(line) for line in lines(summary(self)))

    def _ipython_key_completions_(self) -> list[str]:
        return list(self.names)

    def to_pandas(self) -> Any:
        """All frames as a pandas DataFrame: see Selection. Needs the extra ``export``."""
        return self.select().to_pandas()

    def to_xarray(self) -> Any:
        """All frames as an xarray Dataset: see Selection. Needs the extra ``export``."""
        return self.select().to_xarray()

    def stamp_ns(self, t_us: NDArray[np.int64]) -> NDArray[np.int64]:
        """Device times (n,) in us, converted to the host's clock: Unix ns (n,).

        The result is ``begin_ns`` plus the time elapsed on the host's clock; the drift between the two clocks is
        measured from the arrival times of the blocks. In recordings shorter than ten seconds, or when the board did
        not keep pace with the host, it is ``begin_ns`` plus the time elapsed on the board's clock.
        """
        return self._stamps(t_us)

    @cached_property
    def _stamps(self) -> Stamps:
        stamps = Stamps(self.begin_us, self.begin_ns)
        for t_us, at_ns in self._arrivals():
            stamps.arrived(t_us, at_ns)
        return stamps

    def heads(self) -> list[Block]:
        """The blocks, without their rows unless all has been read."""
        return self._blocks if "_sent" in vars(self) or self._index is None else self._heads

    @cached_property
    def _heads(self) -> list[Block]:
        assert self._index is not None
        every = range(len(self._index.blocks))
        return list(Blocks(self.path, {}, (), check=False, index=self._index, only=every))

    def _arrivals(self) -> Iterator[tuple[int, int]]:
        """Last device time of each block that has rows, and when it had arrived."""
        for block in self.heads():
            if block.rest.last_us is not None and block.all_here_ns != block.arrived_ns:
                yield block.rest.last_us, block.all_here_ns

    def __getitem__(self, finger: int | str) -> StructArray:
        """The frames of one finger, by number or by its recorded name. Raises KeyError for an unknown name."""
        rows: StructArray = self.frames[self.frames["finger"] == finger_of(finger, self.names)]
        return rows

    def clock(self, promised_delay_s: float = 0.01) -> DeviceClock:
        """The board's clock against the recording computer's; its host_time_s is in seconds since 1970.

        Each block was written when its last frame had arrived. A recording holds no round trips, so the stated
        uncertainty rests on ``promised_delay_s``: you promise that in every 5 s at least one of these frames took no
        longer than this from the board to the file.
        """
        clock = DeviceClock(promised_delay_s=promised_delay_s, unix_offset_s=0.0)
        for t_us, at_ns in self._arrivals():
            clock.arrived(t_us + LAST_SAMPLE_US, at_ns / 1e9)
        return clock

    def _gap(self, facts: dict[str, Any]) -> Gap | None:
        try:
            gap = Gap(**facts)
            self.problems.append(gap.words())
            return gap
        except TypeError as error:
            self.problems.append(f"a gap is marked in {self.path.name}, but its entry is damaged ({error})")
            return None

    def _without_metadata(self, damaged: bool) -> str:
        if damaged:
            return f"{self.path} has damaged metadata (wrong checksum) and cannot be used; try another copy"
        if self.problems:
            return (
                f"{self.path} is cut off or damaged and has no readable metadata; try another copy or record it again"
            )
        return f"{self.path} is an MCAP file but not a biotac recording; expected a file written by `biotac record`"

    def _take_metadata(self, metadata: dict[str, str]) -> None:
        layout.check_version(self.path, metadata)
        try:
            if int(metadata["wire"].partition(".")[0]) != wire.WIRE_MAJOR:
                raise RecordingError(
                    f"{self.path} uses wire version {metadata['wire']}, this biotac-gateway reads {wire.WIRE_MAJOR}.x; "
                    "install the version it was recorded with"
                )
            facts = Facts.read(metadata)
        except (KeyError, ValueError) as error:
            raise RecordingError(
                f"{self.path} has damaged metadata ({error}) and cannot be used; try another copy"
            ) from error
        self.metadata = metadata
        self.info, self.sensors, self.names = facts.info, facts.sensors, facts.names
        self.calibrations, self.maps, self.settings = facts.calibrations, facts.maps, facts.settings

    @property
    def finger_settings(self) -> dict[int, dict[Setting, int]]:
        """All settings that affect a finger's results, for the fingers that had a calibration in force."""
        return own_settings(self.settings, self.calibrations)

    @property
    def fingers(self) -> list[int]:
        """Fingers with at least one frame, heartbeat, PAC, BANDS or EVENT."""
        rows = (self._sent, self.idle, self.pac)
        others = {m.finger for m in self.messages if isinstance(m, (wire.Bands, wire.Event))}
        return sorted(others | {int(finger) for table in rows for finger in np.unique(table["finger"])})

    @property
    def begin_us(self) -> int:
        """Device time of the first frame or heartbeat, us; 0 if there is none."""
        times = [block.rest.first_us for block in self.heads() if block.rest.first_us is not None]
        return min(times, default=0)

    @property
    def end_us(self) -> int:
        """Device time of the last frame or heartbeat, us; 0 if there is none."""
        times = [block.rest.last_us for block in self.heads() if block.rest.last_us is not None]
        return max(times, default=0)

    @property
    def begin_ns(self) -> int:
        """``begin_us`` on the host's clock (Unix), in ns; late by the delay of the link."""
        return self.heads()[0].arrived_ns if self.heads() else 0

    def _describe_losses(self, losses: list[tuple[int, int, int]], in_damaged: int) -> None:
        for finger, seq, lost in losses[:10]:
            self.problems.append(f"finger {finger}: {lost} frame(s) missing after frame {seq}")
        if len(losses) > 10:
            self.problems.append(f"{len(losses) - 10} more losses")
        if in_damaged:
            self.problems.append(f"{in_damaged} frame(s) of damaged seconds are missing")
        numbers = {block.number for block in self._blocks}
        if not self.problems and len(numbers) != max(numbers, default=-1) + 1:
            self.problems.append(f"{self.path.name} is damaged: seconds of it are missing")
        if (counts := self.counts).bad:
            self.problems.append(
                f"{counts.bad} packet(s) rejected: {counts.bad_crc} bad CRC, {counts.bad_cobs} bad COBS, "
                f"{counts.bad_length} wrong length, {counts.too_long} too long"
            )
