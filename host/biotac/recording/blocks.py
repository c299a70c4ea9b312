"""The blocks of a recording, one by one, with the wanted fields and fingers."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from mcap.records import Message, Metadata
from numpy.typing import NDArray

from ..wire.frames import StructArray
from . import layout
from .block import FRAME, IDLE, KINDS, ROWS, Packet, Rest, TableReader, packets_of
from .index import Index
from .scan import Scan

_NO_FINGER = np.empty(0, np.uint8)
ALL = {kind: dtype.names or () for kind, dtype in enumerate(ROWS)}


@dataclass(frozen=True)
class Block:
    """``rows``: the wanted fingers and fields, by kind, in order of arrival. ``missing``: FRAMEs in damaged tables."""

    arrived_ns: int
    all_here_ns: int
    number: int
    rows: list[StructArray]
    rest: Rest
    missing: int = 0

    def packets(self) -> Iterator[Packet]:
        """All messages in order of arrival; only for a block with all fields and fingers."""
        return packets_of(self.rest, self.rows)


class Blocks:
    """Iterates over Blocks; ``metadata`` (None until seen) and ``scan.problems`` are complete afterwards.

    With ``index``, only the blocks numbered ``only`` are read.
    """

    def __init__(
        self,
        path: Path,
        wanted: Mapping[int, Collection[str]] = ALL,
        fingers: Collection[int] | None = None,
        *,
        check: bool = True,
        index: Index | None = None,
        only: Iterable[int] = (),
    ) -> None:
        self.metadata: dict[str, str] | None = None
        self.damaged_metadata = 0
        self._wanted = wanted
        self._fingers = None if fingers is None else set(fingers)
        self._is_chosen = None if fingers is None else np.isin(np.arange(256), list(fingers))
        self.scan = Scan(path, self._is_wanted, check=check, index=index, only=only)
        self._reader: TableReader | None = None

    def __iter__(self) -> Iterator[Block]:
        tables: dict[int, bytes] = {}
        number = 0
        for record in self.scan:
            if isinstance(record, Metadata):
                self._take_metadata(record)
                continue
            topic, message = record
            if message.sequence != number:
                if tables or message.sequence < number:
                    self._report_misplaced()
                tables, number = {}, message.sequence
            if topic != layout.PACKETS:
                tables[int(topic.removeprefix(layout.TABLE))] = message.data
                continue
            block = self._block(message, tables)
            if block is not None:
                yield block
            tables = {}

    def _is_wanted(self, topic: str) -> bool:
        if topic.startswith(layout.TABLE):
            finger = topic.removeprefix(layout.TABLE)
            return finger.isdecimal() and (self._fingers is None or int(finger) in self._fingers)
        return topic == layout.PACKETS

    def _take_metadata(self, record: Metadata) -> None:
        try:
            facts = layout.unsigned(record.metadata)
        except ValueError:
            self.damaged_metadata += 1
            self.scan.problems.append(f"{record.name!r} of {self.scan.path.name} is damaged and was skipped")
            return
        if record.name in (layout.METADATA_NAME, layout.METADATA_AGAIN) and self.metadata is None:
            self.metadata = facts

    def _report_misplaced(self) -> None:
        """Report tables that are missing or misplaced, unless an earlier problem already explains it."""
        if not self.scan.problems:
            name = self.scan.path.name
            self.scan.problems.append(f"{name} is damaged: parts of it are missing or out of order, and were skipped")

    def _block(self, message: Message, tables: dict[int, bytes]) -> Block | None:
        try:
            rest = Rest.unpack(message.data)
            if tables and self._reader is None:
                self._reader = TableReader(self.scan.schemas[f"{layout.TABLE}{min(tables)}"], self._wanted)
            wanted = set(rest.fingers) if self._fingers is None else self._fingers.intersection(rest.fingers)
            damaged, missing = wanted - set(tables), 0
            if damaged:
                self._report_misplaced()
                missing = int(np.isin(rest.finger_of_row(FRAME), list(damaged)).sum())
                rest = rest.without(damaged)
            rows = self._rows(rest, tables)
        except (KeyError, TypeError, ValueError, struct.error, IndexError, RecursionError) as error:
            self.scan.damaged_chunks += 1
            self.scan.problems.append(f"one second of {self.scan.path.name} is damaged and was skipped ({error})")
            return None
        return Block(message.publish_time, message.log_time, message.sequence, rows, rest, missing)

    def _rows(self, rest: Rest, tables: dict[int, bytes]) -> list[StructArray]:
        if self._reader is None:
            return [np.empty(0, dtype) for dtype in ROWS]
        of_row = [rest.finger_of_row(kind) if kind in self._wanted else _NO_FINGER for kind in range(len(KINDS))]
        if self._is_chosen is not None:
            of_row = [fingers[self._is_chosen[fingers]] for fingers in of_row]
        rows = [self._reader.rows(kind, fingers) for kind, fingers in enumerate(of_row)]
        for finger, data in tables.items():
            self._reader.read(data, finger, rows)
        return rows


def lost_between(blocks: list[Block]) -> int:
    """FRAMEs of missing blocks, by the sequence numbers around them; losses that are known are left out."""
    lost = 0
    for before, after in pairwise(blocks):
        for finger in before.rest.fingers if after.number > before.number + 1 else ():
            (ends, _), (numbers, rounds) = _numbers(before, finger), _numbers(after, finger)
            if len(ends) and len(numbers):
                first = int(np.argmin(numbers))
                known = sum(n for which, seq, n in after.rest.lost if which == finger and seq < numbers[first])
                lost += max(0, int(numbers[first] - rounds[first] - ends.max()) - known)
    return lost


def _numbers(block: Block, finger: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sequence numbers of a finger's FRAMEs and heartbeats, and how many rounds each stands for."""
    frames, idle = (block.rows[kind][block.rows[kind]["finger"] == finger] for kind in (FRAME, IDLE))
    numbers = np.concatenate([frames["seq"], idle["seq"]]).astype(np.int64)
    return numbers, np.concatenate([np.ones(len(frames)), idle["frames"]]).astype(np.int64)
