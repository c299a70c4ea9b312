"""The quality of a message's counts: which words are stale, and whether they are a BioTac's at all.

Drivers repeat the last word where none came, and other skins are published as BioTacs. The limits are from recordings
of real fingers (host/docs/guides/owners.md).
"""

from __future__ import annotations

from collections import deque

import numpy as np
from numpy.typing import NDArray

from ...wire import messages_gen as wire
from ...wire import sensor_gen as sensor
from .message import Counts

ELECTRODES = len(sensor.ELECTRODE_NAMES)
SP = "24 electrodes are a BioTac SP's: it has contact, but no force"
# Rounds for which an electrode has one count while most others change; fewer while those move by more than noise.
STALE_ROUNDS, STALE_MOVED_ROUNDS, MOVED_COUNTS = 100, 30, 8
LEAST_REST_COUNTS = 1000  # real ones rest at 1870 to 3600
DEAD = 3
DEAD_ROUNDS = 30
REST_ROUNDS = 30  # rounds in which a finger's rest is measured
BEYOND_ROUNDS, BEYOND_OF = 10, 100  # with a count that no BioTac has, among the latest


class CountsCheck:
    """Checks one finger round by round. ``foreign`` says why it is no BioTac with 19 electrodes; empty while it may be.

    ``stale``: a bit mask of electrodes that are stale now.
    """

    def __init__(self, first: list[Counts]) -> None:
        self.foreign = ""
        self._rest: list[NDArray[np.int64]] | None = None  # of a finger without enough rounds
        self.stale = 0
        self._same, self._ever_moved = np.zeros(ELECTRODES, int), np.zeros(ELECTRODES, bool)
        self.begin()
        for own in first:
            self.words(own)
        self._rest = [own.electrodes[:ELECTRODES] for own in first]
        self._look_at_rest()

    def begin(self) -> None:
        """From the first round once more; ``foreign`` stays, and so do electrodes that have one count throughout."""
        frozen = np.array([bool(self.stale >> k & 1) for k in range(ELECTRODES)]) & ~self._ever_moved
        self._same = np.where(frozen, STALE_ROUNDS, -1)
        self._last: NDArray[np.int64] | None = None
        self._recent = np.empty((0, ELECTRODES), int)
        self._round = self._dead = 0
        self._beyond: deque[int] = deque(maxlen=BEYOND_ROUNDS)

    def words(self, own: Counts) -> NDArray[np.uint16]:
        """The round's electrodes (19,), INVALID_COUNT where stale or out of range."""
        counts = own.electrodes[:ELECTRODES]
        beyond = _beyond(counts)
        same = counts == (counts if self._last is None else self._last)
        self._ever_moved |= ~same
        self._same = np.where(same, self._same + 1, 0)
        self._last = counts
        self._recent = np.vstack([self._recent[1 - STALE_MOVED_ROUNDS :], counts])
        stale = self._find_stale()
        self.stale = int((1 << np.flatnonzero(stale & (counts != wire.INVALID_COUNT))).sum()) if stale.any() else 0
        if not self.foreign:
            self._look(own, counts, beyond)
        if self._rest is not None:
            self._rest.append(counts)
            self._look_at_rest()
        return np.where(beyond | stale, wire.INVALID_COUNT, counts).astype(np.uint16)

    def _find_stale(self) -> NDArray[np.bool_]:
        long = self._same >= STALE_MOVED_ROUNDS
        others = ~long
        if not long.any() or 3 * others.sum() < ELECTRODES:
            return np.zeros(ELECTRODES, bool)
        moved = np.median(np.ptp(self._recent[:, others], axis=0)) >= MOVED_COUNTS
        stale: NDArray[np.bool_] = long if moved else self._same >= STALE_ROUNDS
        return stale

    def _look(self, own: Counts, counts: NDArray[np.int64], beyond: NDArray[np.bool_]) -> None:
        zeros = int((counts == 0).sum())
        if len(own.electrodes) != ELECTRODES:
            self.foreign = SP
            return
        self._dead = self._dead + 1 if zeros >= DEAD else 0
        self._round += 1
        if beyond.any():
            self._beyond.append(self._round)
        if self._dead >= DEAD_ROUNDS:
            self._condemn(f"{zeros} electrodes say 0")
        elif len(self._beyond) == BEYOND_ROUNDS and self._beyond[0] > self._round - BEYOND_OF:
            self._condemn(f"counts of up to {counts.max()}, expected 0 to {sensor.FULL_SCALE_COUNT}")

    def _look_at_rest(self) -> None:
        if self._rest is None or len(self._rest) < REST_ROUNDS:
            return
        rest = float(np.median(np.median(self._rest, axis=0)))
        self._rest = None
        if not self.foreign and rest < LEAST_REST_COUNTS:
            self._condemn(f"they rest at {rest:.0f} counts, a BioTac's at 1900 to 3600")

    def _condemn(self, why: str) -> None:
        self.foreign = f"these are not a BioTac's counts: {why}; no force"


def _beyond(counts: NDArray[np.int64]) -> NDArray[np.bool_]:
    beyond: NDArray[np.bool_] = (counts < 0) | (counts > sensor.FULL_SCALE_COUNT) & (counts != wire.INVALID_COUNT)
    return beyond
