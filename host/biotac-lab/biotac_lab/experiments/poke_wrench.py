"""Lin 2013, figure 8: force and torque while E11 to E16 are poked, by the board with the paper's scales, and the truth.

The scales are one number an axis, fitted by least squares to all 19 pokes of the same trial ("accurate when scaled
properly"). The paper draws the two curves and prints no error.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..report import Table
from . import estimates
from .estimates import Estimate
from .trial import Bools, Floats, Trial

ELECTRODES = slice(10, 16)
NAMES = ("Fx [N]", "Fy [N]", "Fz [N]", "Mx [N mm]", "My [N mm]", "Mz [N mm]")


def wrenches(trial: Trial) -> tuple[Floats, Floats]:
    """Force and torque (n, 6): the truth, NaN where the trial has no torque, and the board's."""
    by: Estimate = estimates.by_paper(trial, estimates.paper_scales([trial]))
    assert by.torque_nmm is not None
    return np.hstack([trial.force_n, trial.torque_nmm]), np.hstack([by.force_n, by.torque_nmm])


def rows(contacts: Sequence[Bools]) -> Bools:
    """The frames (n,) of the figure's six pokes."""
    return np.asarray(np.any(contacts[ELECTRODES], axis=0))


def table(trials: dict[str, Trial], contacts: dict[str, Sequence[Bools]]) -> Table:
    """RMSE and correlation of each axis over the six pokes, with the size of the truth."""
    found: list[list[Any]] = []
    for name, trial in trials.items():
        truth, seen = wrenches(trial)
        poked = rows(contacts[name])
        for k, axis in enumerate(NAMES):
            t, y = truth[poked, k], seen[poked, k]
            good = np.isfinite(t) & np.isfinite(y)
            known = good.sum() > 2 and t[good].std() > 1e-6
            r = float(np.corrcoef(t[good], y[good])[0, 1]) if known else None
            rms = [float(np.sqrt((v[good] ** 2).mean())) if good.any() else np.nan for v in (t, y - t)]
            found.append([name, axis, *rms, rms[1] / rms[0] if rms[0] > 1e-6 else np.nan, r])
    text = "E11 to E16, every frame above 1 N, board with the paper's scales, fitted to all 19 pokes of the trial."
    return Table("Figure 8", ["sensor", "axis", "RMS of the truth", "RMSE", "share", "correlation"], found, text)


def draw(trial: Trial, contacts: Sequence[Bools], figure: Any) -> None:
    """The six pokes: force and torque, the board's solid and the truth dashed, as in the paper."""
    truth, seen = wrenches(trial)
    around = np.flatnonzero(rows(contacts))
    span = slice(max(around[0] - 50, 0), around[-1] + 50)
    for axes, first, unit in zip(figure, (0, 3), ("N", "N mm"), strict=True):
        for k, color in zip(range(first, first + 3), ("#dc2626", "#15803d", "#1d4ed8"), strict=True):
            axes.plot(trial.time_s[span], seen[span, k], color=color, linewidth=1, label=NAMES[k].split()[0])
            axes.plot(trial.time_s[span], truth[span, k], color=color, linewidth=1, linestyle="--")
        axes.set(xlabel="s", ylabel=unit, title="figure 8: E11 to E16 in turn; truth dashed")
        axes.grid(alpha=0.25)
        axes.legend(fontsize=8, ncols=3)
