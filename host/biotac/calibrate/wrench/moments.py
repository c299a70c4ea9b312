"""Sums of squares and products, strip by strip: all that fitting and judging a linear model needs.

Drift is trained in exactly rather than by random noise: each row counts at three drifts, 0 and
+-sqrt(3) sigma with weights 2/3, 1/6, 1/6. Those have a Gaussian's moments up to the fifth, so for
features up to second order in e the sums that noise would give on average come out to the last bit,
and the same run gives the same coefficients every time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np
import numpy.typing as npt

from ...core.geometry import Floats
from ...core.map_columns import SIGNAL_COUNTS, Signals
from . import features
from .blocks import Blocks
from .run import Run

DRIFT_SIGMA_COUNTS = 100.0  # what a finger drifts by in about two minutes of warm-up (biotac.md finding 6)
DRIFT_NODES = ((0.0, 2.0 / 3.0), (-np.sqrt(3.0), 1.0 / 6.0), (np.sqrt(3.0), 1.0 / 6.0))
NO_DRIFT = ((0.0, 1.0),)

Nodes = tuple[tuple[float, float], ...]
Columns = Callable[[Signals], Floats]
Rows = npt.NDArray[np.intp]


def aligned(run: Run, lag_rows: int, rows: Rows | None = None) -> Signals:
    """Signals that go with the truth's ``rows``: counts ``lag_rows`` later. Beyond the run's ends are its last ones."""
    index = np.arange(len(run.counts)) if rows is None else rows
    at = np.clip(index + lag_rows, 0, len(run.counts) - 1)
    return Signals(run.counts[at] - run.tare, run.tare, None if run.pdc is None else run.pdc[at])


def smoothed(run: Run, window_rows: int, lag_rows: int, rows: Rows, of: Columns) -> Floats:
    """Mean of ``of`` (n, q) over ``window_rows`` frames around those that go with the truth's ``rows``.

    ``window_rows`` is odd. The mean is of what each frame gives, because a board maps frame by frame and its
    reader takes the mean afterwards; the mean of counts is another thing wherever the map is not linear.
    """
    half = window_rows // 2
    wanted = np.clip(rows[:, None] + np.arange(-half, half + 1), -lag_rows, len(run.counts) - 1 - lag_rows)
    needed, place = np.unique(wanted, return_inverse=True)
    each = of(aligned(run, lag_rows, needed))
    mean: Floats = each[place.reshape(wanted.shape)[:, 0]]
    for k in range(1, window_rows):
        mean += each[place.reshape(wanted.shape)[:, k]]
    mean /= window_rows
    return mean


def linear_columns(signals: Signals) -> Floats:
    """The columns of LINEAR alone: enough for lag and window, and thirty times cheaper."""
    return signals.e / SIGNAL_COUNTS


def with_one(columns: Floats) -> Floats:
    """Columns (n, p) and the offset's column (n, p + 1)."""
    return np.concatenate([columns, np.ones((len(columns), 1))], axis=1)


def moments(
    run: Run,
    blocks: Blocks,
    window_rows: int,
    lag_rows: int,
    columns: Columns = features.columns,
    nodes: Nodes = DRIFT_NODES,
) -> Floats:
    """Z'Z of every strip (60, q, q), Z = [features, 1, truth]."""
    result = []
    for rows in blocks.strips:
        drifting = (
            (weight, smoothed(run, window_rows, lag_rows, rows, drifted(run, at * DRIFT_SIGMA_COUNTS, columns)))
            for at, weight in nodes
        )
        result.append(_products(drifting, run.truth[rows]))
    return np.array(result)


def air_moments(run: Run, columns: Columns = features.columns, nodes: Nodes = DRIFT_NODES) -> Floats | None:
    """Z'Z (q, q) of the frames in free air, whose truth is 0, weighing as much as all of the run; None without."""
    if run.air is None:
        return None
    pdc = None if run.pdc is None else np.zeros(len(run.air))
    signals = Signals(run.air - run.tare, run.tare, pdc)
    drifting = ((weight, drifted(run, at * DRIFT_SIGMA_COUNTS, columns)(signals)) for at, weight in nodes)
    sums = _products(drifting, np.zeros((len(run.air), run.truth.shape[1])))
    return sums * (len(run.truth) / len(run.air))


def drifted(run: Run, mean_counts: float, of: Columns) -> Columns:
    """``of`` signals that have drifted by ``mean_counts`` on average."""
    return lambda signals: of(signals.drifted(mean_counts * run.drift))


def _products(drifting: Iterable[tuple[float, Floats]], truth: Floats) -> Floats:
    """Z'Z, the weighted mean over drift of features (n, p)."""
    total = np.zeros(())
    for weight, shifted in drifting:
        z = np.concatenate([with_one(shifted), truth], axis=1)
        total = total + weight * (z.T @ z)
    return total
