"""The 11-point robust LOWESS of Wettels and Loeb 2011, and a causal smoother for a finger that is still touched."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from biotac import InputError

Floats = npt.NDArray[np.float64]

TAPS = 11
ROBUST_STEPS = 3  # statsmodels' default; MATLAB's rlowess takes 5


def lowess(values: npt.ArrayLike, taps: int = TAPS) -> Floats:
    """Values (n,) or (n, k) smoothed by local lines over ``taps`` rows, without outliers beyond six median residuals.

    Cleveland's robust LOWESS (statsmodels', three robust steps) over the row number, each column by itself. NaN rows
    are skipped and stay NaN. It needs the rows after a row, too; causal() does not. An outlier of a thousand times the
    noise distorts its neighbours and is not rejected. Raises InputError where fewer than ``taps`` rows are finite.
    """
    from statsmodels.nonparametric.smoothers_lowess import lowess as theirs  # half a second to import

    columns = np.asarray(values, dtype=np.float64)
    flat = columns.reshape(len(columns), -1)
    result = np.full(flat.shape, np.nan)
    for k, column in enumerate(flat.T):
        at = np.flatnonzero(np.isfinite(column))
        if len(at) < taps:
            raise InputError(f"{len(at)} rows have a value: expected at least {taps}; smooth a longer stretch")
        result[at, k] = theirs(column[at], at, frac=taps / len(at), it=ROBUST_STEPS, return_sorted=False)
    return result.reshape(columns.shape)


def causal_taps(taps: int = TAPS) -> Floats:
    """Weights (taps,), oldest first, that evaluate at the newest row a line fitted to the last ``taps`` rows.

    The line is fitted with tricube weights that fall to zero one row before the oldest, as in LOWESS at the end of its
    data. The weights sum to 1, and a steady slope is followed without lag.
    """
    age = np.arange(taps - 1, -1, -1.0)
    weight = (1.0 - (age / taps) ** 3) ** 3
    design = np.column_stack([np.ones(taps), -age])
    result: Floats = np.linalg.solve(design.T @ (design * weight[:, None]), (design * weight[:, None]).T)[0]
    return result


def causal(values: npt.ArrayLike, taps: int = TAPS) -> Floats:
    """Values (n,) or (n, k) smoothed by causal_taps() over each row and those before; the first taps - 1 rows are NaN.

    Linear, not robust: a single outlier passes with 0.4 of its size. A NaN makes every row NaN whose window holds it.
    """
    columns = np.asarray(values, dtype=np.float64)
    result = np.full(columns.shape, np.nan)
    if len(columns) >= taps:
        window = np.lib.stride_tricks.sliding_window_view(columns, taps, axis=0)
        result[taps - 1 :] = window @ causal_taps(taps)
    return result
