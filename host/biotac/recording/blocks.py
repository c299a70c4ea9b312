"""The blocks of a recording: one by one, with the wanted fields and fingers, or all of them, checked."""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Message, Metadata
from numpy.typing import NDArray

from ..board.gap import Gap
from ..errors import InputError, RecordingError
from ..wire.batches import known
from ..wire.decoder import pairs
from ..wire.frames import StructArray
from ..wire.framing import FramingCounts
from . import labels, layout
from .block import FRAME, IDLE, KINDS, PAC, ROWS, Rest, TableReader, messages_of
from .scan import Index, Scan

_NO_FINGER = np.empty(0, np.uint8)
ALL = {kind: dtype.names or () for kind, dtype in enumerate(ROWS)}


@dataclass(frozen=True)
class Block:
    """``rows``: the wanted fingers and fields, by kind, in order of arrival."""

    arrived_ns: int
    all_here_ns: int
    number: int
    rows: list[StructArray]
    rest: Rest

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """All (id, payload) in order of arrival; only for a block with all fields and fingers."""
        return messages_of(self.rest, self.rows)


class Blocks:
    """Iterates over Blocks; ``metadata`` (None until seen) and ``scan.problems`` are complete afterwards.

    ``fingers`` are numbers or recorded names. With ``index``, only the blocks numbered ``only`` are read. Raises
    RecordingError as Scan does, InputError for a name that was not recorded.
    """

    def __init__(
        self,
        path: Path,
        wanted: Mapping[int, Collection[str]] = ALL,
        fingers: Collection[int | str] | None = None,
        *,
        check: bool = True,
        index: Index | None = None,
        only: Iterable[int] = (),
    ) -> None:
        self.metadata: dict[str, str] | None = None
        self.damaged_metadata = 0
        self._wanted = wanted
        self._named = fingers
        self.scan = Scan(path, self._is_wanted, check=check, index=index, only=only)
        self._reader: TableReader | None = None

    def __iter__(self) -> Iterator[Block]:
        tables: dict[int, bytes] = {}
        number = 0
        numbers: set[int] = set()
        for record in self.scan:
            if isinstance(record, Metadata):
                self._add_metadata(record)
                continue
            topic, message = record
            if message.sequence != number:
                if message.sequence in numbers:
                    self._report_misplaced("holds two recordings that were merged; read the files that it was made of")
                elif tables or message.sequence < number:
                    self._report_misplaced()
                tables, number = {}, message.sequence
            if topic != layout.REST:
                tables[int(topic.removeprefix(layout.TABLE))] = message.data
                continue
            numbers.add(number)
            block = self._block(message, tables)
            if block is not None:
                yield block
            tables = {}

    @cached_property
    def _fingers(self) -> set[int] | None:
        """The wanted ones, when the metadata is there, which comes first."""
        path, named, names = self.scan.path, self._named, dict[str, int]()
        if named is None:
            return None
        try:
            if any(isinstance(finger, str) for finger in named):
                names = layout.names_of(self.metadata or {})
            return {layout.finger_of(finger, names) for finger in named}
        except KeyError as error:
            raise InputError(f"{path}: {error.args[0]}") from None
        except (TypeError, ValueError, AttributeError, RecursionError, OverflowError) as error:
            raise RecordingError(f"{path} has damaged metadata ({error}); name its fingers by number") from error

    @cached_property
    def _is_chosen(self) -> NDArray[np.bool_]:
        return np.isin(np.arange(256), list(self._fingers or ()))

    def _is_wanted(self, topic: str) -> bool:
        if topic.startswith(layout.TABLE):
            finger = topic.removeprefix(layout.TABLE)
            return finger.isdecimal() and (self._fingers is None or int(finger) in self._fingers)
        return topic == layout.REST

    def _add_metadata(self, record: Metadata) -> None:
        try:
            facts = layout.verified(record.metadata)
        except ValueError:
            self.damaged_metadata += 1
            self.scan.problems.append(f"{record.name!r} of {self.scan.path.name} is damaged and was skipped")
            return
        if record.name in (layout.METADATA_NAME, layout.METADATA_AGAIN) and self.metadata is None:
            self.metadata = facts

    def _report_misplaced(
        self, how: str = "is damaged: parts of it are missing or out of order, and were skipped"
    ) -> None:
        """Report tables that are missing or misplaced, unless an earlier problem already explains it."""
        if not self.scan.problems:
            self.scan.problems.append(f"{self.scan.path.name} {how}")

    def _block(self, message: Message, tables: dict[int, bytes]) -> Block | None:
        try:
            rest = Rest.unpack(message.data)
            if tables and self._reader is None:
                self._reader = TableReader(self.scan.schemas[f"{layout.TABLE}{min(tables)}"], self._wanted)
            wanted = set(rest.fingers) if self._fingers is None else self._fingers.intersection(rest.fingers)
            damaged = wanted - set(tables)
            if damaged:
                self._report_misplaced()
                rest = rest.without(damaged)
            rows = self._rows(rest, tables)
        except (KeyError, TypeError, ValueError, struct.error, IndexError, RecursionError) as error:
            self.scan.damaged_chunks += 1
            self.scan.problems.append(f"one second of {self.scan.path.name} is damaged and was skipped ({error})")
            return None
        return Block(message.publish_time, message.log_time, message.sequence, rows, rest)

    def _rows(self, rest: Rest, tables: dict[int, bytes]) -> list[StructArray]:
        if self._reader is None:
            return [np.empty(0, dtype) for dtype in ROWS]
        of_row = [rest.finger_of_row(kind) if kind in self._wanted else _NO_FINGER for kind in range(len(KINDS))]
        if self._fingers is not None:
            of_row = [fingers[self._is_chosen[fingers]] for fingers in of_row]
        rows = [self._reader.rows(kind, fingers) for kind, fingers in enumerate(of_row)]
        for finger, data in tables.items():
            self._reader.read(data, finger, rows)
        return rows


def gap_of(facts: dict[str, Any]) -> Gap | None:
    """A gap in a block's rest; None for a damaged one."""
    try:
        return Gap(**facts)
    except TypeError:
        return None


class Contents:
    """What ``Recording`` documents, by the same names; ``sent`` are its FRAMEs before they are in user units.

    ``show`` is called with the share of the file that has been read. Raises RecordingError when nothing can be.
    """

    def __init__(self, path: Path, show: Callable[[float], None] = lambda share: None) -> None:
        self._path = path
        scanned = Blocks(path)
        self.blocks: list[Block] = []
        for block in scanned:
            self.blocks.append(block)
            show(scanned.scan.share)
        self.problems: list[str] = []
        self.damage = scanned.scan.problems
        self.cut_off = scanned.scan.cut_off
        self.damaged_chunks = scanned.scan.damaged_chunks
        if scanned.metadata is None:
            raise RecordingError(self._without_metadata(scanned.damaged_metadata > 0, bool(self.blocks)))
        self.metadata = scanned.metadata
        self.arrived_ns = [block.arrived_ns for block in self.blocks]
        # Imported recordings store the first time for both.
        self.all_here_ns = [b.all_here_ns if b.all_here_ns != b.arrived_ns else None for b in self.blocks]
        rests = [block.rest for block in self.blocks]
        self.messages: list[Any] = [message for rest in rests for message in known(pairs(rest.others))]
        self.sent, self.pac, self.idle = (self._rows_of(kind) for kind in (FRAME, PAC, IDLE))
        self.seq, self.t_us = self.sent["seq"].astype(np.int64), self.sent["t_us"]
        self.rejected = [
            {"at_s": (block.arrived_ns - self.arrived_ns[0]) / 1e9, **block.rest.rejected}
            for block in self.blocks
            if block.rest.rejected
        ]
        bad = sum((Counter(rest.rejected) for rest in rests), Counter[str]())
        self.counts = FramingCounts(sum(len(rest.order) for rest in rests), **bad)
        last = max(rests, key=lambda rest: rest.frames, default=Rest(np.empty(0, np.uint16), b""))
        self.pac_lost, self.disordered = last.pac_lost, last.disordered
        self.gaps_before = [[gap for facts in rest.gaps if (gap := self._gap(facts)) is not None] for rest in rests]
        self.gaps = [gap for before_block in self.gaps_before for gap in before_block]
        in_damaged = max(0, last.frames - len(self.sent))  # more where two were merged
        self.frames_lost = last.frames_lost + in_damaged
        if self.cut_off and not len(self.seq):
            raise RecordingError(f"{path} was cut off before its first second was complete; record it again")
        self.damage += labels.read(path, self.arrived_ns[0] if self.arrived_ns else 0)[1]
        self._describe_losses([loss for rest in rests for loss in rest.lost], in_damaged)

    def _rows_of(self, kind: int) -> StructArray:
        return np.concatenate([np.empty(0, ROWS[kind]), *(block.rows[kind] for block in self.blocks)])

    def _gap(self, facts: dict[str, Any]) -> Gap | None:
        gap = gap_of(facts)
        if gap is None:
            self.damage.append(f"a gap is marked in {self._path.name}, but its entry is damaged ({facts})")
        else:
            self.problems.append(gap.line())
        return gap

    def _without_metadata(self, damaged: bool, has_blocks: bool) -> str:
        if damaged:
            return f"{self._path} has damaged metadata (wrong checksum) and cannot be used; try another copy"
        if self.damage:
            return (
                f"{self._path} is cut off or damaged and has no readable metadata; try another copy or record it again"
            )
        if has_blocks:
            how = "as `mcap filter` and `recover` drop it; give them --include-metadata"
            return f"{self._path} has a recording's messages but not its metadata, {how}"
        return f"{self._path} is an MCAP file but not a biotac recording; expected a file written by `biotac record`"

    def _describe_losses(self, losses: list[tuple[int, int, int]], in_damaged: int) -> None:
        for finger, seq, lost in losses[:10]:
            self.problems.append(f"finger {finger}: {lost} frame(s) missing after frame {seq}")
        if len(losses) > 10:
            self.problems.append(f"{len(losses) - 10} more losses")
        if in_damaged:
            self.damage.append(f"{in_damaged} frame(s) of damaged seconds are missing")
        numbers = {block.number for block in self.blocks}
        if not self.damage and len(numbers) != max(numbers, default=-1) + 1:
            self.damage.append(f"{self._path.name} is damaged: seconds of it are missing")
        if (counts := self.counts).bad:
            self.damage.append(
                f"{counts.bad} packet(s) rejected, the first in the second that began at "
                f"{self.rejected[0]['at_s']:.1f} s: {counts.bad_crc} bad CRC, {counts.bad_cobs} bad COBS, "
                f"{counts.bad_length} wrong length, {counts.too_long} too long"
            )
        self.problems = [*self.damage, *self.problems]
