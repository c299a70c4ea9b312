"""Sums of squares and products, strip by strip: all that fitting and judging a linear model needs.

Counts are averaged over a window before anything is made of them: what is not linear grows with noise. Rows stand at
the counts' time, and every axis of the truth is moved by its own lag: so one matrix of columns serves all lags.

Drift is trained in exactly rather than by random noise: each row counts at three drifts, 0 and
+-sqrt(3) sigma with weights 2/3, 1/6, 1/6. Those have a Gaussian's moments up to the fifth, so for
features up to second order in e the sums that noise would give on average come out to the last bit,
and the same run gives the same coefficients every time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...core.geometry import Floats
from ...core.map_columns import SIGNAL_COUNTS, Signals
from . import features
from .run import Run

# A finger drifts by some 100 counts in two minutes of warm-up (biotac.md finding 6). Trained for all of that a map
# loses a tenth of what it could tell of x; trained for this, 100 counts cost at most 0.03 N (F1, F2).
DRIFT_SIGMA_COUNTS = 60.0
DRIFT_NODES = ((0.0, 2.0 / 3.0), (-np.sqrt(3.0), 1.0 / 6.0), (np.sqrt(3.0), 1.0 / 6.0))
NO_DRIFT = ((0.0, 1.0),)

Nodes = tuple[tuple[float, float], ...]
Columns = Callable[[Signals], Floats]
Rows = npt.NDArray[np.intp]


@dataclass(frozen=True)
class Sums:
    """Of weighted rows: ``gram`` (..., q, q) of [columns, 1], ``cross`` (..., q, axes) of those with the truth, and
    ``square`` (..., axes) of the truth; leading dimensions are those of strips.
    """

    gram: Floats
    cross: Floats
    square: Floats

    @property
    def rows(self) -> float:
        """How many there are, by weight."""
        return float(self.gram[-1, -1])

    def of(self, strips: npt.NDArray[np.bool_]) -> Sums:
        """Added up over ``strips``."""
        return Sums(_added(self.gram, strips), _added(self.cross, strips), _added(self.square, strips))

    def plus(self, other: Sums, times: float = 1.0) -> Sums:
        """With ``other``, ``times`` its weight."""
        return Sums(
            self.gram + times * other.gram, self.cross + times * other.cross, self.square + times * other.square
        )

    def axes(self, which: Sequence[int]) -> Sums:
        """Of some columns of the truth."""
        return Sums(self.gram, self.cross[..., list(which)], self.square[..., list(which)])

    def part(self, index: Rows) -> Sums:
        """Of some columns, and 1."""
        index = np.append(index, len(self.gram) - 1)
        return Sums(self.gram[np.ix_(index, index)], self.cross[index], self.square)

    def left_by(self, coefficients: Floats) -> Sums:
        """Of the truth less what ``coefficients`` (q, axes) say."""
        said = self.gram @ coefficients
        return Sums(self.gram, self.cross - said, self.square + (coefficients * (said - 2.0 * self.cross)).sum(axis=0))

    def errors(self, coefficients: Floats) -> Floats:
        """Sum of squared errors (..., axes) of ``coefficients`` (..., q, axes)."""
        fitted = (coefficients * (self.gram @ coefficients - 2.0 * self.cross)).sum(axis=-2)
        # cancellation may leave a perfect fit a hair below zero
        floored: Floats = np.maximum(self.square + fitted, 0.0)
        return floored

    def variance(self) -> Floats:
        """Of the truth (axes,)."""
        result: Floats = self.square / self.rows - (self.cross[-1] / self.rows) ** 2
        return result


def _added(of: Floats, strips: npt.NDArray[np.bool_]) -> Floats:
    # matrix by matrix: a copy of the chosen ones, or a product with zeros and ones, takes three times as long
    total = np.zeros(of.shape[1:])
    for k in np.flatnonzero(strips):
        total += of[k]
    return total


def moved(truth: Floats, lag_rows: int) -> Floats:
    """The truth that goes with counts ``lag_rows`` later. Beyond the run's ends are its last ones."""
    return truth[np.clip(np.arange(len(truth)) - lag_rows, 0, len(truth) - 1)]


def averaged(values: Floats, window_rows: int) -> Floats:
    """Mean over ``window_rows`` rows around each, an odd number; beyond the ends are the ends."""
    half = window_rows // 2
    padded = np.concatenate([values[:1].repeat(half, axis=0), values, values[-1:].repeat(half, axis=0)])
    total: Floats = padded[: len(values)].astype(np.float64)
    for k in range(1, window_rows):
        total = total + padded[k : k + len(values)]
    return total / window_rows


def smoothed(run: Run, window_rows: int) -> Signals:
    """Tared means of the run's counts, and of PDC where there is one."""
    pdc = None if run.pdc is None else averaged(run.pdc, window_rows)
    return Signals(averaged(run.counts, window_rows) - run.tare, run.tare, pdc)


def at(signals: Signals, rows: Rows) -> Signals:
    """Those rows of them."""
    return Signals(signals.e[rows], signals.tare, None if signals.pdc is None else signals.pdc[rows])


def linear_columns(signals: Signals) -> Floats:
    """The columns of LINEAR alone: enough for lag and window, and thirty times cheaper."""
    return signals.e / SIGNAL_COUNTS


def with_one(columns: Floats) -> Floats:
    """Columns (n, p) and the offset's column (n, p + 1)."""
    return np.concatenate([columns, np.ones((len(columns), 1))], axis=1)


def strip_sums(
    signals: Signals,
    truth: Floats,
    drift: Floats,
    columns: Columns = features.columns,
    nodes: Nodes = DRIFT_NODES,
) -> Sums:
    """Over rows of ``signals`` that go with ``truth`` (n, axes); ``drift`` (19,) is what one count of it does."""
    drifting = (
        (weight, with_one(columns(signals.drifted(place * DRIFT_SIGMA_COUNTS * drift)))) for place, weight in nodes
    )
    gram, cross = _products(drifting, truth)
    return Sums(gram, cross, (truth**2).sum(axis=0))


def stacked(strips: Iterable[Sums]) -> Sums:
    """Sums of each strip, as one."""
    every = list(strips)
    return Sums(*(np.stack([getattr(one, name) for one in every]) for name in ("gram", "cross", "square")))


def air_sums(run: Run, window_rows: int, axes: int, nodes: Nodes = DRIFT_NODES) -> Sums | None:
    """Of the frames in free air, whose truth is 0 on all ``axes``, weighing as much as all of the run; None without."""
    if run.air is None:
        return None
    pdc = None if run.pdc is None else np.zeros(len(run.air))
    signals = Signals(averaged(run.air, window_rows) - run.tare, run.tare, pdc)
    its = strip_sums(signals, np.zeros((len(run.air), axes)), run.drift, nodes=nodes)
    share = len(run.truth) / len(run.air)
    return Sums(its.gram * share, its.cross, its.square)


def _products(drifting: Iterable[tuple[float, Floats]], truth: Floats) -> tuple[Floats, Floats]:
    gram, cross = np.zeros(()), np.zeros(())
    for weight, z in drifting:
        gram = gram + weight * (z.T @ z)
        cross = cross + weight * (z.T @ truth)
    return gram, cross
