"""Cutting a run so that nothing leaks from test to training.

Neighbouring rows are the same instant of the same contact twice, so rows are never shuffled: the run
is cut into contiguous blocks, and what lies within a guard of a held-out block is not trained on.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

BLOCKS = 20
GUARD_ROWS = 100


class Blocks:
    """``BLOCKS`` contiguous blocks of ``rows`` rows, each cut into head guard, middle and tail guard.

    Sums are kept per strip, so that any training set is a choice of strips. Where the run rests, an
    edge is moved to the middle of a rest nearby: then no contact is in two blocks.
    """

    def __init__(self, rest: npt.NDArray[np.bool_]) -> None:
        rows = len(rest)
        even = np.linspace(0, rows, BLOCKS + 1).round().astype(np.int64)
        # half of what a block has beyond its guards: two neighbours that give way still hold them
        room = max((rows // BLOCKS - 2 * GUARD_ROWS) // 2, 0)
        middles = _rest_middles(rest)
        self.edges = even.copy()
        self.whole_contacts = 0
        for k in range(1, BLOCKS):
            near = middles[np.abs(middles - even[k]) <= room]
            if len(near):
                self.edges[k] = near[np.argmin(np.abs(near - even[k]))]
                self.whole_contacts += 1
        strips = [(e, e + GUARD_ROWS, n - GUARD_ROWS) for e, n in zip(self.edges[:-1], self.edges[1:], strict=True)]
        self.strips = np.append(np.array(strips).ravel(), rows)

    def rows(self, block: int) -> slice:
        """Rows of a block."""
        return slice(int(self.edges[block]), int(self.edges[block + 1]))

    def own(self, blocks: Iterable[int]) -> npt.NDArray[np.bool_]:
        """Strips (3 * BLOCKS,) of the given blocks."""
        mask = np.zeros(3 * BLOCKS, dtype=np.bool_)
        for block in blocks:
            mask[3 * block : 3 * block + 3] = True
        return mask

    def kept_from(self, blocks: Iterable[int]) -> npt.NDArray[np.bool_]:
        """Strips that may be trained on when the given blocks are held out: not theirs, nor their guards."""
        mask = np.ones(3 * BLOCKS, dtype=np.bool_)
        for block in blocks:
            mask[max(3 * block - 1, 0) : 3 * block + 4] = False
        return mask


def _rest_middles(rest: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    change = np.flatnonzero(np.diff(np.concatenate([[False], rest, [False]]).astype(np.int8)))
    middles: npt.NDArray[np.int64] = (change[::2] + change[1::2]) // 2
    return middles
