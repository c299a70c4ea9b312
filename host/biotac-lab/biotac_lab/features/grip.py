"""Grip state by the Bayes filter of Wettels and Loeb 2011, Eq 7, with histograms to relate sensor values to states.

The grip holds, is about to give, or slips. In each round the states change as often as they did in training, and are
weighted by the histograms' probability of the sensed values. The paper sums over particles; three states can be summed
exactly. Only NumPy is needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

import numpy as np
import numpy.typing as npt

from biotac import InputError
from biotac.kernels.geometry import Floats, grip_parts
from biotac.wire import messages as wire

LAG = 8  # PAC samples over which a change is taken, as in the board's events
EDGES = 4  # bin edges for each state
NAMES = ("shake", "ratio")


class GripState(IntEnum):
    """State of the grip, X in the paper."""

    STABLE = 0
    INCIPIENT = 1
    SLIPPING = 2


STATES = len(GripState)


def load_ratio(force_n: npt.ArrayLike, poc_mm: npt.ArrayLike) -> Floats:
    """Ratio of tangential to normal force (n,), for force (n, 3) in N on the finger at a point of contact (n, 3) in mm.

    NaN where either is unknown or nothing presses.
    """
    force, poc = np.asarray(force_n, dtype=np.float64), np.asarray(poc_mm, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        normal, shear = grip_parts(force, poc).T
        ratio: Floats = np.where(normal > 0.0, shear / normal, np.nan)
    return ratio


def observations(rows: npt.NDArray[Any], pac: npt.ArrayLike) -> Floats:
    """The filter's inputs for each round of one finger (n, 2), in the order of NAMES; NaN where unknown.

    ``rows`` (n,) are frames with ``force_n`` and ``poc_mm``; ``pac`` (n, 22) are the counts of the same rounds, which
    follow each other without a gap. ``shake`` is log10 of the mean squared change of PAC over 8 samples, in count^2 and
    at least 1; ``ratio`` is load_ratio(). Raises InputError for other shapes.
    """
    counts = np.asarray(pac)
    if counts.ndim != 2 or len(counts) != len(rows) or counts.shape[1] <= LAG:
        raise InputError(f"pac has shape {counts.shape} for {len(rows)} frames: expected 22 samples per frame")
    level = np.where(counts == wire.INVALID_COUNT, np.nan, counts.astype(np.float64))
    flat = np.concatenate([np.full(LAG, np.nan), level.ravel()])
    change2 = ((flat[LAG:] - flat[:-LAG]) ** 2).reshape(counts.shape)
    known = np.isfinite(change2)
    mean = np.where(known, change2, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1)
    shake = np.where(known.any(axis=1), np.log10(np.maximum(mean, 1.0)), np.nan)
    return np.column_stack([shake, load_ratio(rows["force_n"], rows["poc_mm"])])


@dataclass(frozen=True)
class Trained:
    """The results of training on k channels, with b bins each, and the three states.

    ``edges`` (k, b - 1) are the bins' inner edges, ``likelihood`` (k, b, 3) the probability of a bin in a state,
    ``transition`` (3, 3) that of moving from row to column, and ``start`` (3,) the share of each state.
    ``friction`` is the lowest load ratio at which a slip began in training, NaN if unknown.
    """

    edges: Floats
    likelihood: Floats
    transition: Floats
    start: Floats
    friction: float

    def weigh(self, observed: Floats) -> Floats:
        """P(observed | state) (n, 3), up to a factor; channels are taken as independent, and a NaN is ignored."""
        weight = np.ones((len(observed), STATES))
        for edges, table, values in zip(self.edges, self.likelihood, observed.T, strict=True):
            known = np.isfinite(values)
            weight[known] *= table[np.searchsorted(edges, values[known])]
        return weight

    def margin_n(self, force_n: npt.ArrayLike, poc_mm: npt.ArrayLike) -> Floats:
        """Tangential force (n,) in N that is left before a slip, below 0 if it should slip already; NaN if unknown."""
        force = np.asarray(force_n, dtype=np.float64)
        ratio = load_ratio(force, poc_mm)
        normal = np.linalg.norm(force, axis=1) / np.sqrt(1.0 + ratio**2)
        left: Floats = normal * (self.friction - ratio)
        return left


def train(observed: npt.ArrayLike, states: npt.ArrayLike) -> Trained:
    """Histograms and transitions from consecutive rounds (n, k) with known ``states`` (n,).

    Every bin and every transition is counted once more than it was seen, so that nothing is impossible. Raises
    InputError when a state is missing.
    """
    values, labels = _rounds(observed), np.asarray(states)
    if labels.shape != (len(values),) or labels.dtype.kind not in "iu" or not np.isin(labels, list(GripState)).all():
        raise InputError(f"states are {labels.dtype} {labels.shape}: expected {len(values)} GripStates, one per round")
    seen = np.bincount(labels, minlength=STATES)
    if not seen.all():
        counted = ", ".join(f"{n} {GripState(k).name.lower()}" for k, n in enumerate(seen))
        raise InputError(f"training has {counted} rounds: expected some of each; record a grip that holds, then slips")
    at = np.arange(1, EDGES + 1) / (EDGES + 1)
    # Quantiles of each state's own values: slips are rare, and edges must lie among their values to tell them apart.
    of_states = np.array([np.nanquantile(values[labels == state], at, axis=0) for state in GripState])
    edges = np.sort(of_states.reshape(-1, values.shape[1]).T, axis=1)
    tables = np.ones((len(edges), edges.shape[1] + 1, STATES))
    for table, bounds, column in zip(tables, edges, values.T, strict=True):
        known = np.isfinite(column)
        np.add.at(table, (np.searchsorted(bounds, column[known]), labels[known]), 1.0)
        table /= table.sum(axis=0)
    moves = np.ones((STATES, STATES))
    np.add.at(moves, (labels[:-1], labels[1:]), 1.0)
    begins = np.flatnonzero((labels[1:] == GripState.SLIPPING) & (labels[:-1] != GripState.SLIPPING))
    at_begin = values[begins, NAMES.index("ratio")] if values.shape[1] == len(NAMES) else np.empty(0)
    friction = float(np.nanmin(at_begin)) if np.isfinite(at_begin).any() else float("nan")
    return Trained(edges, tables, moves / moves.sum(axis=1, keepdims=True), seen / seen.sum(), friction)


class GripFilter:
    """Tracks one finger's grip, round by round."""

    def __init__(self, trained: Trained) -> None:
        self._trained = trained
        self._share = trained.start

    def feed(self, observed: npt.ArrayLike) -> Floats:
        """Probability of each GripState (n, 3) after each round of ``observed`` (n, k). InputError for another k."""
        values = _rounds(observed)
        if values.shape[1] != len(self._trained.edges):
            raise InputError(f"{values.shape[1]} values per round: expected {len(self._trained.edges)}, as in training")
        shares = np.empty((len(values), STATES))
        for k, weight in enumerate(self._trained.weigh(values)):
            share = (self._share @ self._trained.transition) * weight
            self._share = shares[k] = share / share.sum()
        return shares


def _rounds(observed: npt.ArrayLike) -> Floats:
    values = np.asarray(observed, dtype=np.float64)
    if values.ndim != 2:
        raise InputError(f"observed has shape {values.shape}: expected (n, k), one row per round")
    return values
