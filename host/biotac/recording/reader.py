"""Reading a recording, complete or cut off."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..board.gap import Gap
from ..core.bands import bands_of
from ..errors import InputError, RecordingError, path_text
from ..keep.calibration import own_settings
from ..markdown import html_table
from ..wire import messages_gen as wire
from ..wire.frames import BANDS_DTYPE, StructArray, frames_from_wire
from ..wire.framing import FramingCounts
from ..wire.messages_gen import Setting
from . import labels as labels_module
from . import layout
from .blocks import Block, BlockReader, gap_of
from .contents import Contents
from .events import events_of
from .labels import Label, Times, gap_s_at, labels_at, times_of
from .layout import finger_of
from .recorded_board import RecordedBoard
from .scan import Index
from .selection import Selection, fields_named, part_of
from .summary import lines, summary
from .unix_time import UnixTime


def _of_contents(name: str) -> Any:
    return property(lambda recording: getattr(recording._contents, name))


class Recording:
    """A recording in memory.

    ``frames`` (FRAME_DTYPE), ``pac`` (PAC_DTYPE) and the heartbeats ``idle`` (IDLE_DTYPE) are arrays in order of
    arrival. ``wire`` holds the FRAME messages as sent, ``seq`` and ``t_us`` (int64, (n,)) their unwrapped sequence
    numbers and times, ``messages`` everything else (tare changes, status).

    ``settings`` are the board's when the recording began; ``calibrations`` and ``maps`` (bytes, as the board holds
    them) are those in force then, by finger. ``names`` maps names to fingers: ``recording["index"]`` returns that
    finger's frames.

    ``problems`` lists in words everything missing or damaged; the other rows are good. ``damage``: those of the file,
    not of the link. ``cut_off``: the file ends without an index. ``damaged_chunks``: number of omitted seconds.
    ``gaps``: times when the board was away. ``rejected``: damaged packets, for each block with any: ``at_s``, when it
    began after the first one, and how many by kind (``bad_crc``, ``bad_cobs``, ``bad_length``, ``too_long``).

    It consists of blocks of about a second. ``arrived_ns`` is when each block began, ``all_here_ns`` when it was
    complete (None where unknown), both in ns on the host's clock (Unix).

    Of a complete file, opening reads the metadata, and ``select`` only the selected rows; the first use of anything
    else reads and checks all of it. With ``show``, a function of the share of that work done (0 to 1), it is read at
    once. Raises RecordingError when nothing can be read, or when the file has changed since it was opened.
    """

    problems: list[str] = _of_contents("problems")
    damage: list[str] = _of_contents("damage")
    cut_off: bool = _of_contents("cut_off")
    damaged_chunks: int = _of_contents("damaged_chunks")
    arrived_ns: list[int] = _of_contents("arrived_ns")
    all_here_ns: list[int | None] = _of_contents("all_here_ns")
    messages: list[Any] = _of_contents("messages")
    pac: StructArray = _of_contents("pac")
    idle: StructArray = _of_contents("idle")
    seq: NDArray[np.int64] = _of_contents("seq")
    t_us: NDArray[np.int64] = _of_contents("t_us")
    counts: FramingCounts = _of_contents("counts")
    rejected: list[dict[str, Any]] = _of_contents("rejected")
    pac_lost: int = _of_contents("pac_lost")
    disordered: int = _of_contents("disordered")
    frames_lost: int = _of_contents("frames_lost")
    gaps: list[Gap] = _of_contents("gaps")

    def __init__(self, path: str | os.PathLike[str], show: Callable[[float], None] | None = None) -> None:
        self.path = Path(path).absolute()  # wherever the program goes
        self._index = None if show else Index.read(self.path)
        if self._index is not None:
            blocks = BlockReader(self.path, rows=False, index=self._index)
            list(blocks)
            if blocks.metadata is not None and not blocks.scan.problems:
                self._set_metadata(blocks.metadata)
                return
        self._contents = Contents(self.path, show) if show else Contents(self.path)
        self._set_metadata(self._contents.metadata)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.path,)  # another process opens it again

    @cached_property
    def _contents(self) -> Contents:
        if self._index is not None:
            self._index.check(self.path)
        return Contents(self.path)

    def messages_in(self, block: int) -> Iterator[tuple[int, bytes]]:
        """All messages of a block, by number, in order of arrival, as (id, payload)."""
        return self._contents.blocks[block].messages()

    def gaps_before(self, block: int) -> list[Gap]:
        """The gaps between this block, by number, and the one before it."""
        return self._contents.gaps_before[block]

    @cached_property
    def frames(self) -> StructArray:
        """The FRAMEs in user units, FRAME_DTYPE (n,), in order of arrival."""
        return frames_from_wire(self.wire, self.seq, self.t_us)

    @property
    def applied_n(self) -> NDArray[np.float64] | None:
        """The force (n, 3) in N on simulated fingers in ``frames``, NaN where it is not known; None of real ones."""
        return self._contents.applied_n

    def applied_at(self, finger: NDArray[np.uint8], t_us: NDArray[np.int64]) -> NDArray[np.float64]:
        """``applied_n`` of FRAMEs of fingers (n,) at times (n,), by the lowest 32 bits; NaN where there is none."""
        if self.applied_n is None:
            return np.full((len(finger), 3), np.nan)
        own, asked = (t % 2**32 * 8 + f for t, f in ((self.frames["t_us"], self.frames["finger"]), (t_us, finger)))
        order = np.argsort(own)
        rows = order[np.searchsorted(own, asked, sorter=order).clip(0, len(own) - 1)]
        return np.where((own[rows] == asked)[:, None], self.applied_n[rows], np.nan)

    def applied_in(self, block: int) -> NDArray[np.float64] | None:
        """``applied_n`` of a block's frames, by number; None where it is not known."""
        return self._contents.blocks[block].applied_n

    @property
    def wire(self) -> StructArray:
        """The FRAME messages as sent, with seq and t_us wrapped."""
        return self._contents.sent

    @cached_property
    def bands(self) -> StructArray:
        """Energy of PAC per octave, BANDS_DTYPE (n,), finger by finger."""
        each = [bands_of(self.pac[self.pac["finger"] == finger]) for finger in np.unique(self.pac["finger"])]
        return np.concatenate([np.empty(0, BANDS_DTYPE), *each])

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
        for an unknown field, finger or label. Damaged and missing rows are omitted; ``problems`` says so.
        """
        names = (
            None if fields is None else {"finger", "seq", "t_us", *([fields] if isinstance(fields, str) else fields)}
        )
        chosen = fields_named(names)
        spans = [(start_s, stop_s)]
        if labels is not None:
            found = labels_module.spans_us(self.labels, labels, self.begin_us)
            times_s = [((begin - self.begin_us) / 1e6, (end + 1 - self.begin_us) / 1e6) for begin, end in found]
            spans = [(max(start_s, a), b if stop_s is None else min(stop_s, b)) for a, b in times_s]
        rows = np.concatenate([part_of(self.path, self._index, chosen, fingers, *span)[0] for span in spans])
        if fingers is not None and not len(rows):  # none in these seconds, or none at all
            wanted = {fingers} if isinstance(fingers, (int, str)) else set(fingers)
            self._check_present({finger_of(finger, self.names) for finger in wanted})
        by_number = {finger: name for name, finger in self.names.items()}
        return Selection(rows, tuple(chosen), by_number, self.labels_at, self.gap_s_at, self.stamp_ns)

    def labels_at(self, rows: StructArray) -> NDArray[np.str_]:
        """The labels that hold at each of ``rows`` (n,) of this recording."""
        return labels_at(self.labels, rows, self._times if self.labels else {})

    def gap_s_at(self, rows: StructArray) -> NDArray[np.float32]:
        """How long the board, or the row's finger, was away just before each of ``rows`` (n,), in s."""
        gaps = [gap for block in self.heads() for facts in block.head.gaps if (gap := gap_of(facts)) is not None]
        return gap_s_at(gaps, rows, self._times if gaps else {})

    @cached_property
    def _times(self) -> Times:
        has_all = "_contents" in vars(self) or self._index is None
        if has_all:
            return times_of(self.wire["finger"], self.t_us)
        rows = self.select(fields=()).rows
        return times_of(rows["finger"], rows["t_us"])

    @cached_property
    def labels(self) -> list[Label]:
        """Labels in order of time, those about the whole recording first: made live, and with ``mark`` afterwards."""
        live = []
        for facts in (facts for block in self.heads() for facts in block.head.labels):
            with suppress(TypeError, AttributeError, InputError):  # a damaged one
                live.append(Label(**facts))
        return labels_module.read(self.path, self.begin_ns, live)[0]

    def events(self) -> StructArray:
        """Touches, lifts, jolts, slips and changes of trust, EVENT_DTYPE (n,), in order of arrival.

        ``kind`` is the name of an EventKind, ``at_s`` when it began, in device seconds since the first row, as
        ``select`` takes them. ``pandas.DataFrame(recording.events())`` is a table. Empty where none were recorded.
        """
        return events_of(self.messages, self.begin_us)

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
        Label for the rest. Raises InputError for a time or a finger without rows, or where it cannot be written, and
        KeyError for an unknown name.
        """
        last_s = (self.end_us - self.begin_us) / 1e6
        if outside := [s for s in (at_s, until_s) if s is not None and not 0 <= s <= last_s]:
            raise InputError(f"a label at {outside[0]:g} s: {self.path.name} has rows from 0 to {last_s:g} s")
        number = None if finger is None else finger_of(finger, self.names)
        if number is not None:
            self._check_present({number})
        t_us, end_us = (None if s is None else self.begin_us + round(s * 1e6) for s in (at_s, until_s))
        labels_module.append(self.path, self.begin_ns, Label(text, t_us, end_us, number, facts))
        vars(self).pop("labels", None)

    def unmark(self, text: str, at_s: float | None = None) -> int:
        """Remove all labels of this text, or those that begin within 10 ms of ``at_s``; return how many.

        The recording itself is not touched: a live label is removed in the file beside it, too. Raises
        InputError where there is none, or that file cannot be written.
        """
        named = [label for label in self.labels if label.text == text]
        if at_s is not None:
            at_us = self.begin_us + at_s * 1e6
            placed = ((label, label.t_us) for label in named if label.t_us is not None)
            named = [label for label, t_us in placed if abs(max(t_us, self.begin_us) - at_us) <= 10_000]
        if not named:
            texts = ", ".join(sorted({repr(label.text) for label in self.labels if label.text}))
            seen = f"no label {text!r}{'' if at_s is None else f' at {at_s:g} s'}: "
            raise InputError(
                seen + (f"expected one of {texts}" if texts else "this recording has no labels with a text")
            )
        for label in named:
            labels_module.append(self.path, self.begin_ns, label, removed=True)
        vars(self).pop("labels", None)
        return len(named)

    def _check_present(self, fingers: set[int]) -> None:
        present = {finger for block in self.heads() for finger in block.head.fingers}
        if absent := fingers - present:
            seen = ", ".join(map(str, sorted(present))) or "none"
            raise InputError(f"{self.path.name} has no rows of finger {min(absent)}: expected one or more of {seen}")

    def __repr__(self) -> str:
        facts = summary(self)
        return f"<biotac.Recording {lines(facts)[0]}, fingers {list(facts['fingers'])}, {len(self.labels)} label(s)>"

    def _repr_html_(self) -> str:
        about, *others = lines(summary(self))
        return html_table(about, [line.split(": ", 1) for line in others])

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
        keep pace with the host, it is ``begin_ns`` plus the time elapsed on the board's clock. Times from another
        driver's clock stay as they are.
        """
        return self._unix_time(t_us) if self._zero_ns is None else self._zero_ns + t_us * 1000

    @cached_property
    def _unix_time(self) -> UnixTime:
        times = UnixTime(self.begin_us, self.begin_ns)
        for block in self.heads():
            if block.head.last_us is not None and block.all_here_ns != block.arrived_ns:
                times.arrived(block.head.last_us, block.all_here_ns)
        return times

    def heads(self) -> list[Block]:
        """The blocks, without rows unless all has been read."""
        return self._contents.blocks if "_contents" in vars(self) or self._index is None else self._heads

    @cached_property
    def _heads(self) -> list[Block]:
        assert self._index is not None
        every = range(len(self._index.blocks))
        return list(BlockReader(self.path, rows=False, check=False, index=self._index, only=every))

    def __getitem__(self, finger: int | str) -> StructArray:
        """The frames of one finger, by number or recorded name. Raises KeyError for an unknown name."""
        rows: StructArray = self.frames[self.frames["finger"] == finger_of(finger, self.names)]
        return rows

    def _set_metadata(self, metadata: dict[str, str]) -> None:
        layout.check_version(self.path, metadata)
        try:
            facts = RecordedBoard.read(metadata)
        except (KeyError, ValueError) as error:
            raise RecordingError(
                f"{path_text(self.path)} has damaged metadata ({error}) and cannot be used; try another copy"
            ) from error
        self.metadata = metadata
        self.info, self.sensors, self.names = facts.info, facts.sensors, facts.names
        self._zero_ns = facts.zero_ns
        self.calibrations, self.maps, self.settings = facts.calibrations, facts.maps, facts.settings

    @property
    def finger_settings(self) -> dict[int, dict[Setting, int]]:
        """All settings that affect a finger's results, for the fingers that had a calibration in force."""
        return own_settings(self.settings, self.calibrations)

    @property
    def fingers(self) -> list[int]:
        """Fingers with at least one frame, heartbeat, PAC or EVENT."""
        rows = (self._contents.sent, self.idle, self.pac)
        others = {m.finger for m in self.messages if isinstance(m, wire.Event)}
        return sorted(others | {int(finger) for table in rows for finger in np.unique(table["finger"])})

    @property
    def begin_us(self) -> int:
        """Device time of the first frame or heartbeat, us; 0 if there is none."""
        times = [block.head.first_us for block in self.heads() if block.head.first_us is not None]
        return min(times, default=0)

    @property
    def end_us(self) -> int:
        """Device time of the last frame or heartbeat, us; 0 if there is none."""
        times = [block.head.last_us for block in self.heads() if block.head.last_us is not None]
        return max(times, default=0)

    @property
    def begin_ns(self) -> int:
        """``begin_us`` on the host's clock (Unix), in ns, late by the delay of the link, or as stamped."""
        if self._zero_ns is not None:
            return self._zero_ns + self.begin_us * 1000
        return self.heads()[0].arrived_ns if self.heads() else 0
