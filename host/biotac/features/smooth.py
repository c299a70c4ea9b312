"""Seed 000's 11-point robust LOWESS, and what of it can be had while the finger is still being touched."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..errors import InputError

Floats = npt.NDArray[np.float64]

TAPS = 11
ROBUST_STEPS = 3  # statsmodels' default; MATLAB's rlowess takes 5


def lowess(values: npt.ArrayLike, taps: int = TAPS) -> Floats:
    """Values (n,) or (n, k) smoothed by local lines over ``taps`` rows, outliers beyond six medians left out.

    Cleveland's robust LOWESS (statsmodels', three robust steps) over the row number, each column by itself; rows that
    are NaN stay NaN and are skipped. Needs the rows after a row, too: causal() does not.
    An outlier a thousand times the noise takes its neighbours with it and stays. Raises InputError where fewer than
    ``taps`` rows are numbers.
    """
    from statsmodels.nonparametric.smoothers_lowess import lowess as theirs  # half a second to import

    columns = np.asarray(values, dtype=np.float64)
    flat = columns.reshape(len(columns), -1)
    result = np.full(flat.shape, np.nan)
    for k, column in enumerate(flat.T):
        at = np.flatnonzero(np.isfinite(column))
        if len(at) < taps:
            raise InputError(f"{len(at)} rows with a value: expected at least {taps}; smooth more of them together")
        result[at, k] = theirs(column[at], at, frac=taps / len(at), it=ROBUST_STEPS, return_sorted=False)
    return result.reshape(columns.shape)


def causal_taps(taps: int = TAPS) -> Floats:
    """Weights (taps,), oldest first, of the line through the last ``taps`` rows, read at the newest.

    Tricube weights that reach zero at the oldest, as LOWESS has at its end: sum 1, and a steady slope is followed
    without a lag.
    """
    age = np.arange(taps - 1, -1, -1.0)
    weight = (1.0 - (age / taps) ** 3) ** 3
    design = np.column_stack([np.ones(taps), -age])
    result: Floats = np.linalg.solve(design.T @ (design * weight[:, None]), (design * weight[:, None]).T)[0]
    return result


def causal(values: npt.ArrayLike, taps: int = TAPS) -> Floats:
    """Values (n,) or (n, k) by causal_taps() of the rows before and at each; NaN until there are so many.

    Linear, not robust: a single outlier passes with 0.4 of its size. A NaN makes the rows NaN that it is part of.
    """
    columns = np.asarray(values, dtype=np.float64)
    result = np.full(columns.shape, np.nan)
    if len(columns) >= taps:
        window = np.lib.stride_tricks.sliding_window_view(columns, taps, axis=0)
        result[taps - 1 :] = window @ causal_taps(taps)
    return result
