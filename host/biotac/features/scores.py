"""Seed 000's measures of an estimate's quality: RMSE, SMSE, R2 and the percent error of its Eq 6."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.integrate import trapezoid


@dataclass(frozen=True)
class Scores:
    """Errors of one quantity: ``rmse`` in its unit, ``smse`` (MSE over the truth's variance), ``r2`` and ``percent``.

    ``rows`` is how many were compared.
    """

    rmse: float
    smse: float
    r2: float
    percent: float
    rows: int


def score(said: npt.ArrayLike, truth: npt.ArrayLike, *, least: float = 0.0) -> Scores:
    """Scores of ``said`` (n,) against ``truth`` (n,), over the rows where both are finite.

    ``r2`` is the squared correlation: in the paper's Table 3, R2 exceeds 1 - SMSE, which only that can. Eq 6 divides by
    the truth and diverges where it is 0, so ``percent`` is 100 times the integral of ``abs(said - truth)`` over that of
    ``abs(truth)``, by the trapezoidal rule and only over rows with ``abs(truth)`` above ``least``. With fewer than two
    rows all are NaN.
    """
    y, t = np.asarray(said, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    good = np.isfinite(y) & np.isfinite(t)
    y, t = y[good], t[good]
    if len(t) < 2:
        return Scores(np.nan, np.nan, np.nan, np.nan, len(t))
    mse = float(((y - t) ** 2).mean())
    flat = y.std() == 0.0 or t.std() == 0.0
    r2 = np.nan if flat else float(np.corrcoef(y, t)[0, 1] ** 2)
    far = np.abs(t) > least
    whole = float(trapezoid(np.abs(t[far])))
    percent = 100.0 * float(trapezoid(np.abs(y - t)[far])) / whole if whole > 0.0 else np.nan
    return Scores(float(np.sqrt(mse)), mse / float(t.var()) if t.var() > 0.0 else np.nan, r2, percent, len(t))
