"""What a message's counts are worth: which words are stale, and whether they are a BioTac's at all.

Drivers repeat the last word where none came, and other skins are published as BioTacs. The limits are from recordings
of real fingers (host/docs/guides/owners.md).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..wire import messages_gen as wire
from ..wire import sensor_gen as sensor
from .message import Counts

ELECTRODES = len(sensor.ELECTRODE_NAMES)
SP = "24 electrodes are a BioTac SP's: it has contact, but no force"
# Rounds for which an electrode says one count while most others do not; fewer while those move by more than noise.
STALE_ROUNDS, STALE_MOVED_ROUNDS, MOVED_COUNTS = 100, 30, 8
LEAST_REST_COUNTS = 1000  # real ones rest at 1870 to 3600
DEAD = 3
DEAD_ROUNDS = 30
BEYOND_ROUNDS = 10  # with a count that no BioTac has


class Judge:
    """Judges one finger round by round. ``foreign`` says why it is no BioTac with 19 electrodes; empty while it may be.

    ``stale``: a bit mask of electrodes that are stale now.
    """

    def __init__(self, first: list[Counts]) -> None:
        self.foreign = ""
        self.stale = 0
        counts = np.array([own.electrodes[:ELECTRODES] for own in first])
        self._rest = np.median(counts, axis=0)
        self._last, self._recent = counts[0], counts[:1]
        self._same = np.zeros(ELECTRODES, int)
        self._dead = self._beyond = 0
        for own in first:
            self.words(own)
        if not self.foreign and np.median(self._rest) < LEAST_REST_COUNTS:
            self._condemn(f"they rest at {np.median(self._rest):.0f} counts, a BioTac's at 1900 to 3600")

    def words(self, own: Counts) -> NDArray[np.uint16]:
        """The round's electrodes (19,), INVALID_COUNT where stale or out of range."""
        counts = own.electrodes[:ELECTRODES]
        beyond = _beyond(counts)
        self._same = np.where(counts == self._last, self._same + 1, 0)
        self._last = counts
        self._recent = np.vstack([self._recent[1 - STALE_MOVED_ROUNDS :], counts])
        stale = self._find_stale()
        self.stale = int((1 << np.flatnonzero(stale)).sum())
        if not self.foreign:
            self._look(own, counts, beyond)
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
        self._beyond += bool(beyond.any())
        if self._dead >= DEAD_ROUNDS:
            self._condemn(f"{zeros} electrodes say 0")
        elif self._beyond >= BEYOND_ROUNDS:
            self._condemn(f"counts of up to {counts.max()}, expected 0 to {sensor.FULL_SCALE_COUNT}")

    def _condemn(self, why: str) -> None:
        self.foreign = f"these are not a BioTac's counts: {why}; no force"


def _beyond(counts: NDArray[np.int64]) -> NDArray[np.bool_]:
    beyond: NDArray[np.bool_] = (counts < 0) | (counts > sensor.FULL_SCALE_COUNT) & (counts != wire.INVALID_COUNT)
    return beyond
