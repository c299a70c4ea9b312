"""The blocks of a recording: one by one, with the wanted fingers, or only their heads."""

from __future__ import annotations

import struct
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Message, Metadata
from numpy.typing import NDArray

from ..board.gap import Gap
from ..errors import InputError, RecordingError
from ..wire.batches import Batch, StreamDecoder
from ..wire.decoder import pairs
from . import layout
from .block import Head, of_fingers, unpack_applied
from .scan import Index, Scan
from .schema import Translation, translation_of


@dataclass(frozen=True)
class Block:
    """``batch`` holds the rows of the wanted fingers, ``applied_n`` (n, 3) the forces on the FRAMEs, None if unknown.

    ``packets`` are all of any finger. ``losses`` has (finger, seq before, frames lost) for each loss.
    """

    arrived_ns: int
    all_here_ns: int
    number: int
    head: Head
    packets: bytes
    batch: Batch
    applied_n: NDArray[np.float64] | None
    losses: list[tuple[int, int, int]]

    def messages(self) -> Iterator[tuple[int, bytes]]:
        """All (id, payload) in order of arrival."""
        return iter(pairs(self.packets))


class BlockReader:
    """Iterates over a recording's blocks; ``metadata`` (None until seen) and ``scan.problems`` are complete afterwards.

    ``fingers`` are numbers or recorded names; without ``rows``, only heads are read. With ``index``, only the blocks
    numbered ``only`` are read. Raises RecordingError as Scan does, InputError for a name that was not recorded.
    """

    def __init__(
        self,
        path: Path,
        fingers: Collection[int | str] | None = None,
        *,
        rows: bool = True,
        check: bool = True,
        index: Index | None = None,
        only: Iterable[int] = (),
    ) -> None:
        self.metadata: dict[str, str] | None = None
        self.damaged_metadata = 0
        self._named = fingers
        self._topics = {layout.PACKETS, layout.APPLIED, layout.HEAD} if rows else {layout.HEAD}
        self.scan = Scan(path, self._topics.__contains__, check=check, index=index, only=only)
        self._decoder = StreamDecoder()
        self._decoder.accept_newer_minor()
        self._before: Block | None = None

    def __iter__(self) -> Iterator[Block]:
        parts: dict[int, dict[str, Message]] = {}
        done: set[int] = set()
        for record in self.scan:
            if isinstance(record, Metadata):
                self._add_metadata(record)
                continue
            topic, message = record
            own = parts.setdefault(message.sequence, {})
            if message.sequence in done or topic in own:
                self._report_misplaced("holds two recordings that were merged; read the files that it was made of")
                own.clear()
            own[topic] = message
            head = self._head(own)
            if head is not None and own.keys() >= self._expected(head):
                done.add(message.sequence)
                block = self._block(head, parts.pop(message.sequence))
                if block is not None:
                    yield block
        if parts:
            self._report_misplaced()

    @property
    def packets(self) -> int:
        """How many there were in the blocks so far."""
        return self._decoder.counts.good

    def _expected(self, head: Head) -> set[str]:
        has = {layout.HEAD: True, layout.PACKETS: head.has_packets, layout.APPLIED: head.has_applied}
        return {topic for topic in self._topics if has[topic]}

    def _head(self, parts: dict[str, Message]) -> Head | None:
        if layout.HEAD not in parts:
            return None
        try:
            return Head.unpack(parts[layout.HEAD].data)
        except (KeyError, TypeError, ValueError, RecursionError) as error:
            self._report_damaged(error)
            parts.clear()
            return None

    @cached_property
    def fingers(self) -> set[int] | None:
        """The wanted ones, once the metadata is there, which comes first."""
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
    def _translation(self) -> Translation | None:
        return translation_of(self.scan.schemas.get(layout.PACKETS, b""))

    def _add_metadata(self, record: Metadata) -> None:
        if record.name not in (layout.METADATA_NAME, layout.METADATA_AGAIN):
            return
        try:
            facts = layout.verified(record.metadata)
        except ValueError:
            self.damaged_metadata += 1
            self.scan.problems.append(f"{record.name!r} of {self.scan.path.name} is damaged and was skipped")
            return
        self.metadata = self.metadata or facts

    def _report_misplaced(
        self, how: str = "is damaged: parts of it are missing or out of order, and were skipped"
    ) -> None:
        """Report parts that are missing or misplaced, unless an earlier problem already explains it."""
        if not self.scan.problems:
            self.scan.problems.append(f"{self.scan.path.name} {how}")

    def _report_damaged(self, error: Exception) -> None:
        self.scan.damaged_chunks += 1
        self.scan.problems.append(f"one second of {self.scan.path.name} is damaged and was skipped ({error})")

    def _block(self, head: Head, parts: dict[str, Message]) -> Block | None:
        message = parts[layout.HEAD]
        times = message.publish_time, message.log_time
        try:
            packets = parts[layout.PACKETS].data if layout.PACKETS in parts else b""
            if packets and self._translation is not None:
                packets = self._translation.of(packets)
            batch, losses = self._numbered(head, message.sequence, packets)
            applied = parts.get(layout.APPLIED)
            applied_n = None if applied is None else unpack_applied(applied.data, len(batch.wire))
        except (KeyError, TypeError, ValueError, struct.error, IndexError) as error:
            self._report_damaged(error)
            return None
        if self.fingers is not None:
            batch, chosen = of_fingers(batch, self.fingers)
            applied_n = None if applied_n is None else applied_n[chosen]
        block = Block(*times, message.sequence, head, packets, batch, applied_n, losses)
        self._before = block
        return block

    def _numbered(self, head: Head, number: int, packets: bytes) -> tuple[Batch, list[tuple[int, int, int]]]:
        """The block's rows: numbered on from the block before it, or by this block's head if that is missing."""
        decoder, before = self._decoder, self._before
        if before is not None and number == before.number + 1:
            if head.clock_us is not None:
                decoder.skip_to(head.clock_us)
        else:
            rounds = {row.finger: row.seq for row in head.rows if row.seq is not None}
            pacs = {row.finger: row.pac_seq for row in head.rows if row.pac_seq is not None}
            decoder.begin_at(head.clock_us, rounds, pacs)
        losses = len(decoder.lost_after)
        batch = decoder.feed_packets(packets)
        batch.packets = b""  # the block has them: a second copy would double the memory of an hour
        return batch, decoder.lost_after[losses:]


def gap_of(facts: dict[str, Any]) -> Gap | None:
    """A gap in a block's head; None for a damaged one."""
    try:
        return Gap(**facts)
    except TypeError:
        return None
