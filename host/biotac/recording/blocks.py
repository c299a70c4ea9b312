"""The blocks of a recording, one by one: rows of the wanted fields and fingers, or the wire bytes."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.records import Message, Metadata
from numpy.typing import NDArray

from ..hand.gap import GAP
from ..wire.frames import StructArray
from . import layout
from .block import KINDS, Reading, Rest, as_sent, layout_of, read_part, table_dtype, together
from .scan import Scan

ALL = {kind: table_dtype(kind).names or () for kind in range(len(KINDS))}


@dataclass(frozen=True)
class Piece:
    """One block. ``rows``: the wanted fingers and fields, by kind, in order of arrival.

    If ``rest`` is None, the block is ``raw``: wire bytes as they came. ``whole``: none of it is damaged.
    """

    arrived_ns: int
    all_here_ns: int
    number: int
    rows: list[StructArray]
    rest: Rest | None = None
    raw: bytes = b""
    whole: bool = True

    def bytes(self) -> bytes:
        """The wire bytes as they came; only for a piece with all fields and fingers."""
        if self.rest is None:
            return self.raw
        return together(self.rest, [as_sent(rows, kind) for kind, rows in enumerate(self.rows)])


class Blocks:
    """Iterates over Pieces; ``metadata`` (None until seen), ``gaps`` and ``scan.problems`` are complete afterwards."""

    def __init__(
        self,
        path: Path,
        wanted: Mapping[int, Collection[str]] = ALL,
        fingers: Collection[int] | None = None,
        *,
        check: bool = True,
    ) -> None:
        self.metadata: dict[str, str] | None = None
        self.damaged_metadata = 0
        self.gaps: list[dict[str, str]] = []
        self._wanted = wanted
        self._fingers = None if fingers is None else set(fingers)
        self._chosen = None if fingers is None else np.isin(np.arange(256), list(fingers))
        self.scan = Scan(path, self._is_wanted, check=check)
        self._readings: list[Reading] = []

    def __iter__(self) -> Iterator[Piece]:
        parts: dict[int, bytes] = {}
        number = 0
        for record in self.scan:
            if isinstance(record, Metadata):
                self._take_metadata(record)
                continue
            topic, message = record
            if message.sequence != number:
                if parts or message.sequence < number:
                    self._told_misplaced()
                parts, number = {}, message.sequence
            if topic == layout.TOPIC:
                none = [np.empty(0, table_dtype(kind)) for kind in range(len(KINDS))]
                yield Piece(message.publish_time, message.log_time, number, none, raw=message.data)
            elif topic == layout.REST:
                piece = self._piece(message, parts)
                if piece is not None:
                    yield piece
                parts = {}
            else:
                parts[int(topic.removeprefix(layout.PARTS))] = message.data

    def _is_wanted(self, topic: str) -> bool:
        if topic.startswith(layout.PARTS):
            finger = topic.removeprefix(layout.PARTS)
            return finger.isdigit() and (self._fingers is None or int(finger) in self._fingers)
        return topic in (layout.TOPIC, layout.REST)

    def _take_metadata(self, record: Metadata) -> None:
        try:
            facts = layout.unsigned(record.metadata)
        except ValueError:
            self.damaged_metadata += 1
            self.scan.problems.append(f"{record.name!r} of {self.scan.path.name} is damaged and was skipped")
            return
        if record.name == layout.METADATA_NAME and self.metadata is None:
            self.metadata = facts
        elif record.name == f"{layout.METADATA_NAME}.{GAP}":
            self.gaps.append(facts)

    def _told_misplaced(self) -> None:
        """Report parts that are missing or misplaced, unless an earlier problem already explains it."""
        if not self.scan.problems:
            name = self.scan.path.name
            self.scan.problems.append(f"{name} is damaged: parts of it are missing or out of order, and were skipped")

    def _piece(self, message: Message, parts: dict[int, bytes]) -> Piece | None:
        try:
            rest = Rest.unpack(message.data)
            if not self._readings:
                columns = layout_of(self.scan.schemas[layout.REST])
                self._readings = [Reading(kind, its, self._wanted.get(kind)) for kind, its in enumerate(columns)]
            wanted = rest.all_fingers if self._fingers is None else rest.all_fingers & self._fingers
            whole = set(parts) >= wanted
            if not whole:
                self._told_misplaced()
                rest = rest.without(wanted - set(parts))
            rows = self._tables(rest, self._readings)
            for finger, data in parts.items():
                read_part(data, self._readings, rows, finger)
        except (KeyError, TypeError, ValueError, struct.error, IndexError, RecursionError) as error:
            self.scan.damaged_chunks += 1
            self.scan.problems.append(f"one second of {self.scan.path.name} is damaged and was skipped ({error})")
            return None
        return Piece(message.publish_time, message.log_time, message.sequence, rows, rest, whole=whole)

    def _tables(self, rest: Rest, readings: list[Reading]) -> list[StructArray]:
        """Rows for ``read_part`` to fill, by kind, with their fingers set."""
        return [
            reading.table(self._mine(rest.fingers(kind))) if reading.wanted else reading.nothing
            for kind, reading in enumerate(readings)
        ]

    def _mine(self, fingers: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """The wanted ones of ``fingers``."""
        return fingers if self._chosen is None else fingers[self._chosen[fingers]]


def is_lossless(frames: StructArray, pac: StructArray, idle: StructArray) -> bool:
    """True if every finger's rounds are all there, each once, as a FRAME or in a heartbeat, and so is every PAC."""
    for finger in range(8):
        mine, waits = frames["seq"][frames["finger"] == finger], idle[idle["finger"] == finger]
        ends = np.concatenate([mine, waits["seq"]]).astype(np.int64)
        rounds = np.concatenate([np.ones(len(mine), np.int64), waits["frames"]])
        order = np.argsort(ends, kind="stable")
        blocks = pac["seq"][pac["finger"] == finger].astype(np.int64)
        if (np.diff(ends[order]) != rounds[order][1:]).any() or (np.diff(blocks) != 1).any():
            return False
        if (np.diff(mine.astype(np.int64)) <= 0).any():
            return False
    return True
