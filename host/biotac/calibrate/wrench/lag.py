"""The number of rows by which counts lag the force, and whether they follow it at all.

Two loggers, a ROS synchroniser or an F/T sensor's own filter shift one against the other by tens of milliseconds. Data
that is a whole second off, or from two files that do not belong together, still gives coefficients.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...errors import RecordingError
from ...kernels.geometry import Floats
from ...map.columns import Signals
from .models import solve
from .moments import NO_DRIFT, Rows, at, linear_columns, stacked, strip_sums
from .plate_recording import Run
from .splits import BLOCKS, Blocks

SEARCH_ROWS = 50
MAX_LAG_ROWS = 20  # 0.2 s at 100 Hz: more is not a transport delay but another clock
APART_ROWS = 5  # an axis's lag against the common one: skin creeps longer under shear than under a press (F1 2/5/2)
MIN_R2 = 0.3  # held out; the weakest real finger has 0.5 to 0.9, unrelated files have less than 0
LAGS: npt.NDArray[np.int64] = np.arange(-SEARCH_ROWS, SEARCH_ROWS + 1)
LEAST_RIDGE = 1e-6


class Lags:
    """Fits of the affine model to a run at every lag."""

    def __init__(self, run: Run, blocks: Blocks) -> None:
        self._run, self._blocks = run, blocks
        self._axes = run.truth.shape[1]
        signals = Signals(run.counts - run.tare, run.tare)
        self._sums = stacked(
            strip_sums(at(signals, rows), self._at_lags(rows), run.drift, linear_columns, NO_DRIFT)
            for rows in blocks.strips
        )

    def _at_lags(self, rows: Rows) -> Floats:
        """The truth (n, lags * axes) of ``rows``, as ``moved`` by each of LAGS."""
        late = np.clip(rows[:, None] - LAGS, 0, len(self._run.truth) - 1)
        moved: Floats = self._run.truth[late].reshape(len(rows), len(LAGS) * self._axes)
        return moved

    def common(self, strips: npt.NDArray[np.bool_]) -> int:
        """The lag in rows at which the model explains most of the truth, on ``strips`` alone."""
        return int(LAGS[np.argmin(self._unexplained(strips).mean(axis=1))])

    def of_axes(self, strips: npt.NDArray[np.bool_]) -> tuple[int, ...]:
        """Each axis's own best lag in rows, within APART_ROWS of the common one."""
        unexplained = self._unexplained(strips)
        apart = np.abs(LAGS - LAGS[np.argmin(unexplained.mean(axis=1))])
        unexplained[apart > APART_ROWS] = np.inf
        return tuple(int(lag) for lag in LAGS[unexplained.argmin(axis=0)])

    def check(self) -> tuple[int, float]:
        """Common lag in rows over the whole run, and the held-out R2 there.

        Raises RecordingError when force and counts do not match or the lag is too large, unless the run is aligned by
        clocks.
        """
        lag = self.common(self._blocks.own(range(BLOCKS)))
        r2 = self._held_out_r2(lag)
        where = f"{self._run.name}: force and counts"
        if self._run.by_clocks:
            # the clocks' correlation had a clear peak, and with small tips an affine map fails at held-out places
            return lag, r2
        if r2 < MIN_R2:
            raise RecordingError(
                f"{where} are not aligned: they agree best at a lag of {lag} rows, where an affine map has a held-out "
                f"R2 of {r2:.2f}: expected at least {MIN_R2:g}; are both from the same run and finger, row by row?"
            )
        if abs(lag) > MAX_LAG_ROWS:
            raise RecordingError(
                f"{where} are not aligned: counts lag the force by {lag} rows (R2 {r2:.2f}): expected at most "
                f"{MAX_LAG_ROWS}, which is corrected automatically; shift one of them"
            )
        return lag, r2

    def _unexplained(self, strips: npt.NDArray[np.bool_]) -> npt.NDArray[np.float64]:
        """Unexplained share of the truth's variance (lags, axes)."""
        sums = self._sums.over(strips)
        share = sums.errors(solve(sums, LEAST_RIDGE)) / np.maximum(sums.rows * sums.variance(), 1e-12)
        return share.reshape(len(LAGS), self._axes)

    def _held_out_r2(self, lag: int) -> float:
        first = (lag + SEARCH_ROWS) * self._axes
        force = self._sums.axes(range(first, first + 3))
        total = np.zeros(3)
        for block in range(BLOCKS):
            fitted = solve(force.over(self._blocks.training_strips([block])), LEAST_RIDGE)
            total += force.over(self._blocks.own([block])).errors(fitted)
        every = force.over(self._blocks.own(range(BLOCKS)))
        return float(1.0 - total.sum() / max(every.rows * every.variance().sum(), 1e-12))
