"""Sums of squares and products, strip by strip: all that fitting and judging a linear model needs.

Drift is trained in exactly rather than by random noise: each row counts at three drifts, 0 and
+-sqrt(3) sigma with weights 2/3, 1/6, 1/6. Those have a Gaussian's moments up to the fifth, so for
features up to second order in e the sums that noise would give on average come out to the last bit,
and the same run gives the same coefficients every time.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from . import features
from .blocks import Blocks
from .features import Signals
from .recorded import Floats, Run

DRIFT_SIGMA_COUNTS = 100.0  # what a finger drifts by in about two minutes of warm-up (biotac.md finding 6)
DRIFT_NODES = ((0.0, 2.0 / 3.0), (-np.sqrt(3.0), 1.0 / 6.0), (np.sqrt(3.0), 1.0 / 6.0))
NO_DRIFT = ((0.0, 1.0),)

Nodes = tuple[tuple[float, float], ...]
Columns = Callable[[Signals], Floats]


def aligned(run: Run, window_rows: int, lag_rows: int, rows: slice = slice(None)) -> Signals:
    """Signals that go with the truth's ``rows``: counts ``lag_rows`` later, mean over ``window_rows``.

    ``window_rows`` is odd and centred. Rows beyond the run's ends are its last ones.
    """
    index = np.arange(len(run.counts))[rows] + lag_rows
    half = window_rows // 2
    e = np.zeros((len(index), run.counts.shape[1]))
    pdc = None if run.pdc is None else np.zeros(len(index))
    for shift in range(-half, half + 1):
        at = np.clip(index + shift, 0, len(run.counts) - 1)
        e += run.counts[at]
        if pdc is not None and run.pdc is not None:
            pdc += run.pdc[at]
    return Signals(e / window_rows - run.tare, run.tare, None if pdc is None else pdc / window_rows)


def linear_columns(signals: Signals) -> Floats:
    """The columns of LINEAR alone: enough for lag and window, and thirty times cheaper."""
    return signals.e / features.SIGNAL_COUNTS


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
    result: list[Floats] = []
    for start, stop in zip(blocks.strips[:-1], blocks.strips[1:], strict=True):
        rows = slice(int(start), int(stop))
        signals = aligned(run, window_rows, lag_rows, rows)
        total: Floats | None = None
        for at, weight in nodes:
            shifted = columns(signals.drifted(at * DRIFT_SIGMA_COUNTS * run.drift))
            z = np.concatenate([with_one(shifted), run.truth[rows]], axis=1)
            part = weight * (z.T @ z)
            total = part if total is None else total + part
        assert total is not None
        result.append(total)
    return np.array(result)
