"""Cutting a run so that nothing leaks from test to training.

Neighbouring rows are almost the same instant of the same contact, so rows are never shuffled: the run is cut into
contiguous blocks, and rows within a guard of a held-out block are not trained on. A run that says which contact each
row belongs to is cut by contacts instead, and needs no guard.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ...errors import RecordingError

BLOCKS = 20
GUARD_ROWS = 100


def contacts(path: Path, given: npt.NDArray[Any], rows: int) -> npt.NDArray[np.int64]:
    """Field ``contact`` (n,), each row's contact. Raises RecordingError when there are too few for the blocks."""
    if given.shape != (rows,) or given.dtype.kind not in "iu":
        raise RecordingError(
            f"{path}: field contact is {given.dtype} {given.shape}: expected ({rows},) integers, one contact per row"
        )
    several = len(np.unique(given))
    if several < BLOCKS:
        raise RecordingError(
            f"{path}: field contact names {several} contacts: expected at least {BLOCKS}, one per block; "
            "touch more places, or omit it to have blocks cut by time"
        )
    return given.astype(np.int64)


class Blocks:
    """``BLOCKS`` blocks of the run's rows, each cut into three strips: head guard, middle and tail guard.

    ``strips`` are arrays of row indices. Sums are made for each strip, so that any training set is a choice of strips.
    Blocks are contiguous; an edge is moved to the middle of a rest nearby if there is one, so that no contact is in two
    blocks. With ``contact`` (n,), each row's contact, each block is a twentieth of the contacts, and guards are empty.
    """

    def __init__(self, rest: npt.NDArray[np.bool_], contact: npt.NDArray[np.int64] | None = None) -> None:
        self.by_contact = contact is not None
        self.contacts = self.whole_contacts = 0
        if contact is not None:
            names, number = np.unique(contact, return_inverse=True)
            self.contacts = len(names)
            # shuffled: if contacts are numbered along the finger, a block must not be one region
            order = np.random.default_rng(0).permutation(len(names))
            block_of = (order % BLOCKS)[number.reshape(-1)]
            self.strips = [
                np.flatnonzero(block_of == k // 3) if k % 3 == 1 else np.zeros(0, dtype=np.intp)
                for k in range(3 * BLOCKS)
            ]
            return
        rows = len(rest)
        even = np.linspace(0, rows, BLOCKS + 1).round().astype(np.int64)
        # half of a block without guards: a block that shrinks at both edges still holds its guards
        room = max((rows // BLOCKS - 2 * GUARD_ROWS) // 2, 0)
        change = np.flatnonzero(np.diff(np.concatenate([[False], rest, [False]]).astype(np.int8)))
        middles = (change[::2] + change[1::2]) // 2
        edges = even.copy()
        for k in range(1, BLOCKS):
            near = middles[np.abs(middles - even[k]) <= room]
            if len(near):
                edges[k] = near[np.argmin(np.abs(near - even[k]))]
                self.whole_contacts += 1
        strips = [(e, e + GUARD_ROWS, n - GUARD_ROWS) for e, n in pairwise(edges)]
        bounds = np.append(np.array(strips).ravel(), rows)
        self.strips = [np.arange(a, b) for a, b in pairwise(bounds)]

    def rows(self, block: int) -> npt.NDArray[np.intp]:
        return np.concatenate(self.strips[3 * block : 3 * block + 3])

    def own(self, blocks: Iterable[int]) -> npt.NDArray[np.bool_]:
        """Mask (3 * BLOCKS,) of the given blocks' strips."""
        mask = np.zeros(3 * BLOCKS, dtype=np.bool_)
        for block in blocks:
            mask[3 * block : 3 * block + 3] = True
        return mask

    def training_strips(self, blocks: Iterable[int]) -> npt.NDArray[np.bool_]:
        """Mask (3 * BLOCKS,) of the strips to train on when the given blocks are held out: neither those nor the guards
        of the neighbours next to them.
        """
        mask = np.ones(3 * BLOCKS, dtype=np.bool_)
        for block in blocks:
            mask[max(3 * block - 1, 0) : 3 * block + 4] = False
        return mask
