"""Checks the times of another sensor's samples before anything is aligned by them."""

from __future__ import annotations

import warnings

import numpy as np
import numpy.typing as npt

from ..errors import RecordingError, RecordingWarning, printable

Floats = npt.NDArray[np.float64]

MAX_SPAN_S = 86_400.0  # a day in steps of 10 ms is 70 MB for each array that an alignment needs
MAX_EQUAL = 0.1  # share of the samples that have the time of the one before
_UNITS = (("ms", 1e3), ("us", 1e6), ("ns", 1e9))


def looks_like(value: float, low: float, high: float) -> str:
    """The unit in which times are if ``value``, a rate in their unit, is to lie from ``low`` to ``high`` Hz."""
    found = [unit for unit, per_s in _UNITS if low <= value * per_s <= high]
    return f"t looks like {found[0]}: expected s; divide it" if found else "is t in s?"


def seconds(where: str, t: npt.ArrayLike, samples: int) -> Floats:
    """``t`` as float64 (n,). Raises RecordingError unless there is a number for each of ``samples``."""
    given = np.asarray(t)
    if given.dtype.kind in "Mm" or (given.dtype == object and given.size and hasattr(given.flat[0], "year")):
        raise RecordingError(f"{where}: t is {given.dtype}: expected s; give (t - t[0]) / np.timedelta64(1, 's')")
    if given.ndim != 1 or given.dtype.kind not in "fiu" or len(given) != samples:
        raise RecordingError(f"{where}: t is {given.dtype} {given.shape}: expected {samples} numbers, a time a sample")
    return given.astype(np.float64)


def increasing(where: str, t_s: Floats) -> npt.NDArray[np.bool_]:
    """Mask (n,) of the usable samples: of several at one time, the first, with a warning.

    Raises RecordingError for fewer than two, and for times that go back, leap, or are not in s.
    """
    if len(t_s) < 2:
        raise RecordingError(f"{where}: {len(t_s)} samples: expected a recording of several minutes; record again")
    step = np.diff(t_s)
    if (step <= 0.0).all() and step.min() < 0.0:
        raise RecordingError(f"{where}: time runs backwards, from {t_s[0]:.6f} to {t_s[-1]:.6f} s; reverse the samples")
    if not (step >= 0.0).all():
        k = int(np.argmin(step >= 0.0))  # a NaN is not above 0 either
        raise RecordingError(
            f"{where}: time goes from {t_s[k]:.6f} to {t_s[k + 1]:.6f} s after sample {k}: expected "
            "increasing times; sort the samples, or use one run at a time"
        )
    kept = np.append(True, step > 0.0)
    equal = int((~kept).sum())
    if equal > MAX_EQUAL * len(t_s):
        raise RecordingError(
            f"{where}: {equal} of {len(t_s)} samples have the time of the one before: expected increasing times; "
            "were they rounded?"
        )
    if equal:
        k = int(np.argmin(kept))
        seen = f"{where}: {equal} sample(s) have the time of the one before, first at {t_s[k]:.6f} s"
        warnings.warn(printable(f"{seen}: the first of each is kept"), RecordingWarning, stacklevel=3)
    span_s, k = float(t_s[-1] - t_s[0]), int(np.argmax(step))
    if span_s > MAX_SPAN_S:
        usual_s = float(np.median(step[step > 0.0]))
        if step[k] > max(0.5 * span_s, 100.0 * usual_s):
            how = f"its clock jumps by {step[k]:.6g} s after sample {k}; use the part before or after it"
        else:
            how = looks_like(1.0 / usual_s, 20.0, 20_000.0)
        raise RecordingError(f"{where}: times span {span_s:.6g} s: expected at most {MAX_SPAN_S:g}; {how}")
    return kept
