"""The 11-point robust LOWESS and the 5 Hz filter of Wettels and Loeb 2011, and a causal smoother for a live finger."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy

from biotac import InputError

Floats = npt.NDArray[np.float64]

TAPS = 11
ROBUST_STEPS = 5  # MATLAB's rlowess
OUTSIDE_SIGMAS = 6.0  # "zero weight to data points outside six standard deviations in its history"
SIGMA_PER_MAD = 1.4826
LOW_PASS_HZ, LOW_PASS_POLES = 5.0, 3  # the paper, II.A


def lowess(values: npt.ArrayLike) -> Floats:
    """Values (n,) or (n, k) smoothed by local lines over TAPS rows, without outliers.

    Cleveland's robust LOWESS (statsmodels', as many robust steps as MATLAB's) over the row number, each column by
    itself. A lone row outside six standard deviations of those around it has no weight (outliers()): the robust steps
    alone would let one outlier of a thousand deviations bend all neighbours. NaN rows are skipped and stay NaN. It
    needs the rows after a row, too; causal() does not. Raises InputError where fewer than TAPS rows are left.
    """
    from statsmodels.nonparametric.smoothers_lowess import lowess as theirs  # half a second to import

    columns = np.asarray(values, dtype=np.float64)
    flat = columns.reshape(len(columns), -1)
    result = np.full(flat.shape, np.nan)
    for k, column in enumerate(flat.T):
        at = np.flatnonzero(np.isfinite(column))
        good = at[~outliers(column[at])]
        if len(good) < TAPS:
            raise InputError(f"{len(good)} rows have a value: expected at least {TAPS}; smooth a longer stretch")
        smooth = theirs(column[good], good, frac=TAPS / len(good), it=ROBUST_STEPS, return_sorted=False)
        result[at, k] = scipy.interpolate.interp1d(good, smooth, fill_value="extrapolate")(at)
    return result.reshape(columns.shape)


def outliers(values: Floats) -> npt.NDArray[np.bool_]:
    """Mask (n,) of lone values (n,) outside six deviations from the median of the TAPS around them (Hampel 1974).

    The deviation is the median one of the same rows, so that a slope widens it. Where half of them are equal it is 0,
    and any other value is outside. A real sensor's glitches are single rows; two beside each other are a short touch,
    and stay for the robust steps to judge.
    """
    if len(values) < TAPS:
        return np.zeros(len(values), np.bool_)
    begin = np.clip(np.arange(len(values)) - TAPS // 2, 0, len(values) - TAPS)
    around = values[begin[:, None] + np.arange(TAPS)]
    middle = np.median(around, axis=1)
    deviation = SIGMA_PER_MAD * np.median(np.abs(around - middle[:, None]), axis=1)
    outside = np.abs(values - middle) > OUTSIDE_SIGMAS * deviation
    beside = np.convolve(outside, [1, 0, 1], "same") > 0
    return np.asarray(outside & ~beside)


def low_pass(values: npt.ArrayLike, rate_hz: float) -> Floats:
    """Values (n,) or (n, k), read ``rate_hz`` times a second, through the paper's 3-pole 5 Hz low-pass, from rest.

    The paper names no kind: this is Butterworth's. Causal; a slope comes out 64 ms late. Raises InputError for a rate
    that is not above 10 Hz.
    """
    if not rate_hz > 2.0 * LOW_PASS_HZ:
        raise InputError(f"{rate_hz:g} rows a second: expected more than {2 * LOW_PASS_HZ:g} for {LOW_PASS_HZ:g} Hz")
    columns = np.asarray(values, dtype=np.float64)
    sections = scipy.signal.butter(LOW_PASS_POLES, LOW_PASS_HZ, fs=rate_hz, output="sos")
    flat = columns.reshape(len(columns), -1)
    start = scipy.signal.sosfilt_zi(sections)[:, :, None] * flat[0]
    result: Floats = scipy.signal.sosfilt(sections, flat, axis=0, zi=start)[0].reshape(columns.shape)
    return result


def causal_taps() -> Floats:
    """Weights (TAPS,), oldest first, that evaluate at the newest row a line fitted to the last TAPS rows.

    The line is fitted with tricube weights that fall to zero one row before the oldest, as in LOWESS at the end of the
    data. The weights sum to 1, and a steady slope is followed without lag.
    """
    age = np.arange(TAPS - 1, -1, -1.0)
    weight = (1.0 - (age / TAPS) ** 3) ** 3
    design = np.column_stack([np.ones(TAPS), -age])
    result: Floats = np.linalg.solve(design.T @ (design * weight[:, None]), (design * weight[:, None]).T)[0]
    return result


def causal(values: npt.ArrayLike) -> Floats:
    """Values (n,) or (n, k) smoothed by causal_taps() over each row and those before; the first TAPS - 1 rows are NaN.

    Linear, not robust: a single outlier passes with 0.4 of the size. A NaN makes every row NaN that has it in the
    window.
    """
    columns = np.asarray(values, dtype=np.float64)
    result = np.full(columns.shape, np.nan)
    if len(columns) >= TAPS:
        window = np.lib.stride_tricks.sliding_window_view(columns, TAPS, axis=0)
        result[TAPS - 1 :] = window @ causal_taps()
    return result
