"""Reading a recording, complete or cut off."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..clock import LAST_SAMPLE_US, DeviceClock
from ..errors import RecordingError
from ..hand.gap import Gap
from ..keep.calibration import own_settings
from ..wire import messages_gen as wire
from ..wire.batches import Batch, StreamDecoder, join
from ..wire.frames import StructArray
from ..wire.messages_gen import Setting
from . import layout
from .bands import recorded_bands
from .block import FRAME, IDLE, PAC, as_sent
from .blocks import Blocks, is_lossless
from .facts import Facts
from .layout import finger_of
from .stamps import Stamps
from .tabular import to_pandas, to_xarray


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

    ``blocks`` are the wire bytes as they came, about one block per second. ``arrived_ns`` is when each block began,
    ``all_here_ns`` when it was complete (None where unknown), both in ns on the host's clock (Unix).

    Raises RecordingError when nothing can be read. ``show`` is called with the share of the work done, 0 to 1.
    """

    def __init__(self, path: str | os.PathLike[str], show: Callable[[float], None] = lambda share: None) -> None:
        self.path = Path(path)
        self.gaps: list[Gap] = []
        blocks = Blocks(self.path)
        self._pieces = list(blocks)
        self._take_facts(blocks)
        self.arrived_ns: list[int] = [piece.arrived_ns for piece in self._pieces]
        # Imported recordings store the first time for both.
        self.all_here_ns: list[int | None] = [
            piece.all_here_ns if piece.all_here_ns != piece.arrived_ns else None for piece in self._pieces
        ]
        decoder = StreamDecoder()
        decoder.accept_newer_minor()
        batch = self._rows(decoder) or self._decoded(decoder, show)
        show(1.0)
        self._batch = batch  # seq and t_us of its wire may be unwrapped
        self.seq, self.t_us = batch.seq, batch.t_us
        self.pac: StructArray = batch.pac
        self.idle: StructArray = batch.idle
        self.messages: list[Any] = batch.messages
        self.frames_lost = decoder.lost
        self.pac_lost = decoder.lost_pac
        self.disordered = decoder.disordered
        if self.cut_off and not len(self.seq):
            raise RecordingError(f"{self.path} was cut off before its first second was complete; record it again")
        self._describe_losses(decoder)

    def _take_facts(self, blocks: Blocks) -> None:
        self.problems: list[str] = blocks.scan.problems
        self.cut_off = blocks.scan.cut_off
        self.damaged_chunks = blocks.scan.damaged_chunks
        self.wrong_checksums = blocks.scan.wrong_checksums
        for facts in blocks.gaps:
            self._take_gap(facts)
        if blocks.metadata is None:
            raise RecordingError(self._without_metadata(blocks.damaged_metadata > 0))
        try:
            self._take_metadata(blocks.metadata)
        except (KeyError, TypeError, ValueError, AttributeError, RecursionError, OverflowError) as error:
            raise RecordingError(
                f"{self.path} has damaged metadata ({error}) and cannot be used; try another copy"
            ) from error
        numbers = {piece.number for piece in self._pieces}
        missing = max(numbers, default=-1) + 1 - len(numbers) - self.damaged_chunks
        if self.metadata["format"] != "1" and missing > 0:
            self.problems.append(
                f"{missing} second(s) of {self.path.name} are missing: the file is too damaged to find them"
            )

    def _rows(self, decoder: StreamDecoder) -> Batch | None:
        """The rows of all pieces; None when the wire must be decoded to find out what is missing."""
        pieces = self._pieces
        if not pieces or any(piece.rest is None or not piece.whole for piece in pieces):
            return None
        sent, pac, idle = (np.concatenate([piece.rows[kind] for piece in pieces]) for kind in (FRAME, PAC, IDLE))
        if not is_lossless(sent, pac, idle):
            return None
        others = decoder.feed(b"".join(piece.rest.raw for piece in pieces if piece.rest))
        if len(others.wire) or len(others.pac) or len(others.idle):
            return None
        self._take_arrivals([piece.rest.last_us if piece.rest else None for piece in pieces])
        self.counts = replace(decoder.counts, good=decoder.counts.good + len(sent) + len(pac) + len(idle))
        rows = Batch(sent, sent["seq"].astype(np.int64), sent["t_us"], pac, idle, others.messages)
        return rows

    def _decoded(self, decoder: StreamDecoder, show: Callable[[float], None]) -> Batch:
        parts = []
        for k, piece in enumerate(self._pieces):
            parts.append(decoder.feed(piece.bytes()))
            show((k + 1) / len(self._pieces))
        self._take_arrivals([part.last_t_us() for part in parts])
        self.counts = decoder.counts
        return join(parts)

    def _take_arrivals(self, last_us: list[int | None]) -> None:
        """``last_us``: last device time of each block's rows, None or 0 for a block without rows."""
        ends = zip(last_us, self.all_here_ns, strict=True)
        self._arrivals = [(t_us, at_ns) for t_us, at_ns in ends if t_us and at_ns is not None]

    @property
    def frames(self) -> StructArray:
        """The FRAMEs in user units, FRAME_DTYPE (n,), in order of arrival."""
        return self._batch.frames

    @cached_property
    def wire(self) -> StructArray:
        """The FRAME messages as sent, with seq and t_us wrapped."""
        return as_sent(self._batch.wire, FRAME)

    @cached_property
    def bands(self) -> StructArray:
        """Energy of PAC per octave, BANDS_DTYPE (n,), finger by finger: as recorded, or else computed from ``pac``."""
        return recorded_bands(self.pac, self.messages, self.begin_us)

    @cached_property
    def blocks(self) -> list[bytes]:
        """The wire bytes as they came, about one second per block."""
        return [piece.bytes() for piece in self._pieces]

    def to_pandas(self) -> Any:
        """The frames as a pandas DataFrame (tabular.py), in order of arrival. Needs the extra ``pandas``."""
        return to_pandas(self.frames, self.stamp_ns(self.frames["t_us"]))

    def to_xarray(self) -> Any:
        """The frames as an xarray Dataset (tabular.py). Needs the extra ``pandas``."""
        return to_xarray(self.frames, self.stamp_ns(self.frames["t_us"]))

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
        for t_us, at_ns in self._arrivals:
            stamps.arrived(t_us, at_ns)
        return stamps

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
        for t_us, at_ns in self._arrivals:
            clock.arrived(t_us + LAST_SAMPLE_US, at_ns / 1e9)
        return clock

    def _take_gap(self, text: dict[str, str]) -> None:
        try:
            gap = Gap.from_text(text)
        except (KeyError, ValueError) as error:
            self.problems.append(f"a gap is marked in {self.path.name}, but its record is damaged ({error})")
            return
        self.gaps.append(gap)
        self.problems.append(gap.words())

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
        major = metadata["wire"].partition(".")[0]
        if int(major) != wire.WIRE_MAJOR:
            raise RecordingError(
                f"{self.path} uses wire version {metadata['wire']}, this biotac-gateway reads {wire.WIRE_MAJOR}.x; "
                "install the version it was recorded with"
            )
        self.metadata = metadata
        facts = Facts.read(metadata)
        self.info, self.sensors, self.names = facts.info, facts.sensors, facts.names
        self.calibrations, self.maps, self.settings = facts.calibrations, facts.maps, facts.settings

    @property
    def finger_settings(self) -> dict[int, dict[Setting, int]]:
        """All settings that affect a finger's results, for the fingers that had a calibration in force."""
        return own_settings(self.settings, self.calibrations)

    @property
    def fingers(self) -> list[int]:
        """Fingers with at least one frame, heartbeat, PAC, BANDS or EVENT."""
        rows = (self._batch.wire, self.idle, self.pac)
        told = {m.finger for m in self.messages if isinstance(m, (wire.Bands, wire.Event))}
        return sorted(told | {int(finger) for table in rows for finger in np.unique(table["finger"])})

    @property
    def begin_us(self) -> int:
        """Device time of the first frame or heartbeat, us; 0 if there is none."""
        return self._batch.first_t_us() or 0

    @property
    def end_us(self) -> int:
        """Device time of the last frame or heartbeat, us; 0 if there is none."""
        return self._batch.last_t_us() or 0

    @property
    def begin_ns(self) -> int:
        """``begin_us`` on the host's clock (Unix), in ns; late by the delay of the link."""
        return self.arrived_ns[0] if self.arrived_ns else 0

    def _describe_losses(self, decoder: StreamDecoder) -> None:
        for finger, seq, lost in decoder.lost_after[:10]:
            self.problems.append(f"finger {finger}: {lost} frame(s) missing after frame {seq}")
        if len(decoder.lost_after) > 10:
            self.problems.append(f"{len(decoder.lost_after) - 10} more gaps")
        counts = decoder.counts
        if counts.bad:
            self.problems.append(
                f"{counts.bad} packet(s) rejected: {counts.bad_crc} bad CRC, {counts.bad_cobs} bad COBS, "
                f"{counts.bad_length} wrong length, {counts.too_long} too long"
            )
