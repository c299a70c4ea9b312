"""Sums of squares and products, strip by strip: enough to fit a linear model and to measure its error.

Counts are averaged over a window before features are computed, because nonlinear features amplify noise. Rows are at
the counts' time, and every axis of the truth is shifted by its own lag, so one matrix of columns serves all lags.

Drift is included in training exactly rather than by random noise: each row is used at three drifts, 0 and +-sqrt(3)
sigma, with weights 2/3, 1/6, 1/6. These have a Gaussian's moments up to the fifth, so for features up to second order
in e the sums are exactly those that noise would give on average, and the same run always gives the same coefficients.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...kernels.geometry import Floats
from ...map.columns import SIGNAL_COUNTS, Signals, columns
from .plate_recording import Run

# A finger drifts by some 100 counts in two minutes of warm-up; a hold sees only the drift after the board's tare.
# Training for more takes some of the shear from light touches, whose signals are as small.
DRIFT_SIGMA_COUNTS = 50.0
# A hand acts on a share of the force, so the relative error is made small: rows weigh as 1 / (this + |F|)^2.
# Unweighted, presses of several newtons decide alone (F2 at 1 to 2 N: bias -0.19 N instead of -0.06).
SHARE_FROM_N = 0.7
DRIFT_NODES = ((0.0, 2.0 / 3.0), (-np.sqrt(3.0), 1.0 / 6.0), (np.sqrt(3.0), 1.0 / 6.0))
NO_DRIFT = ((0.0, 1.0),)
CACHED_COLUMNS = 4096  # of so many, a float64 of each strip fits into a core's own cache

Nodes = tuple[tuple[float, float], ...]
Columns = Callable[[Signals], Floats]
Rows = npt.NDArray[np.intp]


@dataclass(frozen=True)
class WeightedSums:
    """Sums over weighted rows; leading dimensions are those of strips.

    ``gram`` (..., q, q) is of the products of [columns, 1], ``cross`` (..., q, axes) of these with the truth, and
    ``square`` (..., axes) of the truth's squares.
    """

    gram: Floats
    cross: Floats
    square: Floats

    @property
    def rows(self) -> float:
        """Total weight of the rows."""
        return float(self.gram[-1, -1])

    def over(self, strips: npt.NDArray[np.bool_]) -> WeightedSums:
        """The sum over the strips where ``strips`` is true."""
        return self.over_each([strips])[0]

    def over_each(self, masks: Sequence[npt.NDArray[np.bool_]]) -> list[WeightedSums]:
        """``over`` of each of the ``masks``."""
        chosen = np.array(masks, np.float64)
        sums = (_added(values, chosen) for values in (self.gram, self.cross, self.square))
        return [WeightedSums(*each) for each in zip(*sums, strict=True)]

    def plus(self, other: WeightedSums, times: float = 1.0) -> WeightedSums:
        """The sum with ``times`` the ``other`` sums."""
        return WeightedSums(
            self.gram + times * other.gram, self.cross + times * other.cross, self.square + times * other.square
        )

    def times(self, factor: float) -> WeightedSums:
        return WeightedSums(self.gram * factor, self.cross * factor, self.square * factor)

    def axes(self, which: Sequence[int]) -> WeightedSums:
        return WeightedSums(self.gram, self.cross[..., list(which)], self.square[..., list(which)])

    def part(self, index: Rows) -> WeightedSums:
        """Sums of some columns, and of the column of ones."""
        index = np.append(index, len(self.gram) - 1)
        return WeightedSums(self.gram[np.ix_(index, index)], self.cross[index], self.square)

    def errors(self, coefficients: Floats) -> Floats:
        """Sum of squared errors (..., axes) of ``coefficients`` (..., q, axes)."""
        fitted = (coefficients * (self.gram @ coefficients - 2.0 * self.cross)).sum(axis=-2)
        # cancellation may leave a perfect fit slightly below zero
        floored: Floats = np.maximum(self.square + fitted, 0.0)
        return floored

    def variance(self) -> Floats:
        """Variance of the truth (axes,)."""
        result: Floats = self.square / self.rows - (self.cross[-1] / self.rows) ** 2
        return result


def _added(values: Floats, chosen: Floats) -> Floats:
    """Sums (m, ...) of values (strips, ...) by ``chosen`` (m, strips), zeros and ones."""
    flat = values.reshape(len(values), -1)
    total = np.empty((len(chosen), flat.shape[1]))
    for first in range(0, flat.shape[1], CACHED_COLUMNS):
        part = slice(first, first + CACHED_COLUMNS)
        np.matmul(chosen, flat[:, part], out=total[:, part])
    return total.reshape(len(chosen), *values.shape[1:])


def moved(truth: Floats, lag_rows: int) -> Floats:
    """The truth shifted to counts that lag it by ``lag_rows``. Beyond the run's ends it repeats the end rows."""
    return truth[np.clip(np.arange(len(truth)) - lag_rows, 0, len(truth) - 1)]


def averaged(values: Floats, window_rows: int) -> Floats:
    """Mean over ``window_rows`` rows, an odd number, around each row; beyond the ends it repeats the end rows."""
    half = window_rows // 2
    padded = np.concatenate([values[:1].repeat(half, axis=0), values, values[-1:].repeat(half, axis=0)])
    total: Floats = padded[: len(values)].astype(np.float64)
    for k in range(1, window_rows):
        total = total + padded[k : k + len(values)]
    return total / window_rows


def smoothed(run: Run, window_rows: int) -> Signals:
    """Means of the run's counts above the tare, and of PDC where there is one."""
    pdc = None if run.pdc is None else averaged(run.pdc, window_rows)
    return Signals(averaged(run.counts, window_rows) - run.tare, run.tare, pdc)


def at(signals: Signals, rows: Rows) -> Signals:
    return Signals(signals.e[rows], signals.tare, None if signals.pdc is None else signals.pdc[rows])


def linear_columns(signals: Signals) -> Floats:
    """The columns of AFFINE alone: enough to choose lag and window, and thirty times cheaper."""
    return signals.e / SIGNAL_COUNTS


def row_weights(run: Run) -> Floats:
    """How much each of the run's rows counts (n,), by the row's force alone; see SHARE_FROM_N."""
    weights: Floats = (SHARE_FROM_N + np.linalg.norm(run.truth[:, :3], axis=1)) ** -2.0
    return weights


def strip_sums(
    signals: Signals,
    truth: Floats,
    drift: Floats,
    to_columns: Columns = columns,
    nodes: Nodes = DRIFT_NODES,
    weights: Floats | None = None,
) -> WeightedSums:
    """Sums over rows of ``signals`` and ``truth`` (n, axes); ``drift`` (19,) is per count of mean drift.

    ``weights`` (n,) are those of the rows; 1 if None.
    """
    root = np.ones(len(truth)) if weights is None else np.sqrt(weights)
    roots = np.sqrt([share for _, share in nodes])[:, None] * root
    found = [to_columns(signals.drifted(node * DRIFT_SIGMA_COUNTS * drift)) for node, _ in nodes]
    z = np.empty((*roots.shape, found[0].shape[1] + 1))
    for own, each, scale in zip(z, found, roots, strict=True):
        np.multiply(each, scale[:, None], out=own[:, :-1])
    z[..., -1] = roots
    z, scaled = z.reshape(roots.size, z.shape[-1]), np.concatenate(truth * roots[..., None])
    return WeightedSums(z.T @ z, z.T @ scaled, ((truth * root[:, None]) ** 2).sum(axis=0))


def stacked(strips: Iterable[WeightedSums]) -> WeightedSums:
    every = list(strips)
    return WeightedSums(*(np.stack([getattr(sums, name) for sums in every]) for name in ("gram", "cross", "square")))


def air_sums(run: Run, window_rows: int) -> WeightedSums | None:
    """Sums of the frames in free air, with truth 0 on all axes and the whole run's weight; None without such frames."""
    if run.air is None:
        return None
    pdc = None if run.pdc is None else np.zeros(len(run.air))
    signals = Signals(averaged(run.air, window_rows) - run.tare, run.tare, pdc)
    sums = strip_sums(signals, np.zeros((len(run.air), run.truth.shape[1])), run.drift)
    share = len(run.truth) / len(run.air)
    return WeightedSums(sums.gram * share, sums.cross, sums.square)
