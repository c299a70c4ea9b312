"""By how many rows the counts come later than the force, and whether they follow it at all.

Two loggers, a ROS synchroniser or an F/T sensor's own filter shift one against the other by tens of
milliseconds; a whole second off, or two files that do not belong together, still gives coefficients.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...core.geometry import Floats
from ...errors import RecordingError
from .blocks import BLOCKS, Blocks
from .models import AFFINE, solve, squared_errors, truth_variance
from .moments import NO_DRIFT, linear_columns, moments
from .run import Run

SEARCH_ROWS = 50
MAX_LAG_ROWS = 20  # 0.2 s at 100 Hz: more is no transport delay but another clock
MIN_R2 = 0.3  # held out; the weakest real finger has 0.5 to 0.9 (biotac.md 5), unrelated files have less than 0
LAGS: npt.NDArray[np.int64] = np.arange(-SEARCH_ROWS, SEARCH_ROWS + 1)
_WEAKEST = slice(0, 1)  # least ridge


def lag_moments(run: Run, blocks: Blocks) -> Floats:
    """Sums (101, 60, q, q) of the affine model at every lag of LAGS."""
    return np.array([moments(run, blocks, 1, int(lag), linear_columns, NO_DRIFT) for lag in LAGS])


def best_lag(run: Run, at_lags: Floats, strips: npt.NDArray[np.bool_]) -> int:
    """The lag in rows at which the affine model explains most of the truth, on ``strips`` alone."""
    return int(LAGS[np.argmin([_unexplained(run, at[strips].sum(axis=0)) for at in at_lags])])


def check(run: Run, blocks: Blocks, at_lags: Floats) -> tuple[int, float]:
    """Lag in rows and held-out R2 there, on the whole run. Raises RecordingError for what cannot be trusted."""
    lag = best_lag(run, at_lags, blocks.own(range(BLOCKS)))
    r2 = _held_out_r2(run, blocks, at_lags[lag + SEARCH_ROWS])
    where = f"{run.name}: force and counts"
    if run.by_clocks:
        # their correlation had a clear peak, and small tips in places held out leave an affine map nothing to say
        return lag, r2
    if r2 < MIN_R2:
        raise RecordingError(
            f"{where} are not aligned: they agree best at a lag of {lag} rows, and there an affine map explains "
            f"R2 {r2:.2f} held out: expected at least {MIN_R2:g}; are both of the same run and finger, row by row?"
        )
    if abs(lag) > MAX_LAG_ROWS:
        raise RecordingError(
            f"{where} are not aligned: counts come {lag} rows after the force (R2 {r2:.2f}): expected at most "
            f"{MAX_LAG_ROWS}, which would be corrected; shift one of them"
        )
    return lag, r2


def _unexplained(run: Run, sums: Floats) -> float:
    axes = run.truth.shape[1]
    errors = squared_errors(solve(AFFINE, sums, axes, run.tare)[_WEAKEST], sums, axes)[0]
    return float((errors / np.maximum(truth_variance(sums, axes), 1e-12)).mean())


def _held_out_r2(run: Run, blocks: Blocks, sums: Floats) -> float:
    axes = run.truth.shape[1]
    total = np.zeros(axes)
    for block in range(BLOCKS):
        coefficients = solve(AFFINE, sums[blocks.kept_from([block])].sum(axis=0), axes, run.tare)[_WEAKEST]
        total += squared_errors(coefficients, sums[blocks.own([block])].sum(axis=0), axes)[0]
    variance = truth_variance(sums.sum(axis=0), axes)[:3].sum() * len(run.truth)
    return float(1.0 - total[:3].sum() / max(variance, 1e-12))
