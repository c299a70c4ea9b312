"""All blocks of a recording, checked, and all damage and gaps in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..board.gap import Gap
from ..errors import RecordingError
from ..wire.batches import join
from ..wire.framing import FramingCounts
from . import labels, layout
from .block import Head
from .blocks import Block, BlockReader, gap_of


class Contents:
    """The attributes of ``Recording``, by the same names; ``sent`` are the FRAMEs before they are in user units.

    ``show`` is called with the share of the file that has been read. Raises RecordingError when nothing can be.
    """

    def __init__(self, path: Path, show: Callable[[float], None] = lambda share: None) -> None:
        self._path = path
        scanned = BlockReader(path)
        self.blocks: list[Block] = []
        for block in scanned:
            self.blocks.append(block)
            show(scanned.scan.share)
        self.blocks.sort(key=lambda block: block.number)  # another program may have put them in another order
        self.problems: list[str] = []
        self.damage = scanned.scan.problems
        self.cut_off = scanned.scan.cut_off
        self.damaged_chunks = scanned.scan.damaged_chunks
        if scanned.metadata is None:
            raise RecordingError(self._without_metadata(scanned.damaged_metadata > 0, bool(self.blocks)))
        layout.check_version(path, scanned.metadata)
        self.metadata = scanned.metadata
        self.arrived_ns = [block.arrived_ns for block in self.blocks]
        # Imported recordings store the first time for both.
        self.all_here_ns = [b.all_here_ns if b.all_here_ns != b.arrived_ns else None for b in self.blocks]
        heads = [block.head for block in self.blocks]
        whole = join([block.batch for block in self.blocks])
        self.messages: list[Any] = whole.messages
        self.sent, self.seq, self.t_us, self.pac, self.idle = whole.wire, whole.seq, whole.t_us, whole.pac, whole.idle
        self.rejected = [
            {"at_s": (block.arrived_ns - self.arrived_ns[0]) / 1e9, **block.head.rejected}
            for block in self.blocks
            if block.head.rejected
        ]
        bad = sum((Counter(head.rejected) for head in heads), Counter[str]())
        self.counts = FramingCounts(scanned.packets, **bad)
        last = max(heads, key=lambda head: head.frames, default=Head())
        self.pac_lost, self.disordered = last.pac_lost, last.disordered
        self.gaps_before = [[gap for facts in head.gaps if (gap := self._gap(facts)) is not None] for head in heads]
        self.gaps = [gap for before_block in self.gaps_before for gap in before_block]
        in_damaged = max(0, last.frames - len(self.sent))  # more where two were merged
        self.frames_lost = last.frames_lost + in_damaged
        if self.cut_off and not len(self.seq):
            raise RecordingError(f"{path} was cut off before its first second was complete; record it again")
        self.damage += labels.read(path, self.arrived_ns[0] if self.arrived_ns else 0)[1]
        self._describe_losses([loss for block in self.blocks for loss in block.losses], in_damaged)

    @cached_property
    def applied_n(self) -> NDArray[np.float64] | None:
        """The forces (n, 3) in N on simulated fingers in ``sent``, NaN where they are not known; None of real ones."""
        if all(block.applied_n is None for block in self.blocks):
            return None
        known = [np.full((len(b.batch.wire), 3), np.nan) if b.applied_n is None else b.applied_n for b in self.blocks]
        return np.concatenate(known)

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
