"""How Wettels and Loeb 2011 score an estimate: RMSE, SMSE, R2 and the percent error of their Eq 6."""

from __future__ import annotations

import numpy as np
import scipy

from ..report import Facts, plain
from .trial import Floats


def score(estimate: Floats, truth: Floats, *, least: float = 0.0) -> Facts:
    """Scores of an estimate (n,) against the truth (n,), over the rows where both are finite.

    ``smse`` is the mean squared error over the truth's variance, ``r2`` the squared correlation: in the paper's Table
    3, R2 exceeds 1 - SMSE, which only that can. ``printed`` is Eq 6 as printed, 100 times the integral of
    ``abs(estimate - truth) / truth``, over rows numbered from 0 to 1: it diverges where the truth is 0, and errors of
    pushes to either side cancel. So ``percent`` is the ratio of the integrals of ``abs(estimate - truth)`` and of
    ``abs(truth)``, over rows with ``abs(truth)`` above ``least``. With fewer than two rows all are None.
    """
    good = np.isfinite(estimate) & np.isfinite(truth)
    y, t = estimate[good], truth[good]
    if len(t) < 2:
        return dict.fromkeys(("rmse", "smse", "r2", "percent", "printed"))
    mse = float(((y - t) ** 2).mean())
    integral, far = scipy.integrate.trapezoid, np.abs(t) > least
    with np.errstate(divide="ignore", invalid="ignore"):
        r2 = np.corrcoef(y, t)[0, 1] ** 2
        percent = 100.0 * integral(np.abs(y - t)[far]) / np.float64(integral(np.abs(t[far])))
        printed = 100.0 * integral(np.abs(y - t) / t, dx=1.0 / (len(t) - 1))
        smse = mse / t.var()
    found = {"rmse": mse**0.5, "smse": smse, "r2": r2, "percent": percent, "printed": printed}
    return {name: plain(value) for name, value in found.items()}
