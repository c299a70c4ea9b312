"""Everything in a recording's file: read and checked from first byte to last."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..board.gap import Gap
from ..errors import RecordingError
from ..wire.batches import StreamDecoder
from ..wire.frames import StructArray
from . import labels
from .block import FRAME, IDLE, PAC, ROWS
from .blocks import Block, Blocks, lost_between


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
        self.problems: list[str] = scanned.scan.problems
        self.cut_off = scanned.scan.cut_off
        self.damaged_chunks = scanned.scan.damaged_chunks
        self.wrong_checksums = scanned.scan.wrong_checksums
        if scanned.metadata is None:
            raise RecordingError(self._without_metadata(scanned.damaged_metadata > 0))
        self.metadata = scanned.metadata
        self.arrived_ns = [block.arrived_ns for block in self.blocks]
        # Imported recordings store the first time for both.
        self.all_here_ns = [b.all_here_ns if b.all_here_ns != b.arrived_ns else None for b in self.blocks]
        decoder = StreamDecoder()
        decoder.accept_newer_minor()
        self.messages: list[Any] = decoder.feed(b"".join(block.rest.packets for block in self.blocks)).messages
        self.sent, self.pac, self.idle = (self._rows_of(kind) for kind in (FRAME, PAC, IDLE))
        self.seq, self.t_us = self.sent["seq"].astype(np.int64), self.sent["t_us"]
        rows = len(self.sent) + len(self.pac) + len(self.idle)
        self.counts = replace(decoder.counts, good=decoder.counts.good + rows)
        rests = [block.rest for block in self.blocks]
        self.pac_lost = sum(rest.lost_pac for rest in rests)
        self.disordered = sum(rest.disordered for rest in rests)
        self.gaps_before = [[gap for facts in rest.gaps if (gap := self._gap(facts)) is not None] for rest in rests]
        self.gaps = [gap for before_block in self.gaps_before for gap in before_block]
        in_damaged = sum(block.missing for block in self.blocks) + lost_between(self.blocks)
        self.frames_lost = sum(frames for rest in rests for _, _, frames in rest.lost) + in_damaged
        if self.cut_off and not len(self.seq):
            raise RecordingError(f"{path} was cut off before its first second was complete; record it again")
        self.problems += labels.read(path, self.arrived_ns[0] if self.arrived_ns else 0)[1]
        self._describe_losses([loss for rest in rests for loss in rest.lost], in_damaged)

    def _rows_of(self, kind: int) -> StructArray:
        return np.concatenate([np.empty(0, ROWS[kind]), *(block.rows[kind] for block in self.blocks)])

    def _gap(self, facts: dict[str, Any]) -> Gap | None:
        try:
            gap = Gap(**facts)
            self.problems.append(gap.words())
            return gap
        except TypeError as error:
            self.problems.append(f"a gap is marked in {self._path.name}, but its entry is damaged ({error})")
            return None

    def _without_metadata(self, damaged: bool) -> str:
        if damaged:
            return f"{self._path} has damaged metadata (wrong checksum) and cannot be used; try another copy"
        if self.problems:
            return (
                f"{self._path} is cut off or damaged and has no readable metadata; try another copy or record it again"
            )
        return f"{self._path} is an MCAP file but not a biotac recording; expected a file written by `biotac record`"

    def _describe_losses(self, losses: list[tuple[int, int, int]], in_damaged: int) -> None:
        for finger, seq, lost in losses[:10]:
            self.problems.append(f"finger {finger}: {lost} frame(s) missing after frame {seq}")
        if len(losses) > 10:
            self.problems.append(f"{len(losses) - 10} more losses")
        if in_damaged:
            self.problems.append(f"{in_damaged} frame(s) of damaged seconds are missing")
        numbers = {block.number for block in self.blocks}
        if not self.problems and len(numbers) != max(numbers, default=-1) + 1:
            self.problems.append(f"{self._path.name} is damaged: seconds of it are missing")
        if (counts := self.counts).bad:
            self.problems.append(
                f"{counts.bad} packet(s) rejected: {counts.bad_crc} bad CRC, {counts.bad_cobs} bad COBS, "
                f"{counts.bad_length} wrong length, {counts.too_long} too long"
            )
