"""Pictures of one grasp and of what became of all things, over friction and fragility."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from biotac import FrameFlags

from ..report import Facts
from . import runs
from .plant import things
from .runs import CONTROLLERS, TRUE, Case


def draw(figure: Any, cases: list[Case], outcomes: dict[tuple[Case, int], Facts], law_file: Path) -> None:
    """Above a grasp of the first thing, by a board if one was tried; below, a panel for each controller."""
    case = next((case for case in cases if case.controller not in TRUE), cases[0])
    names = list(dict.fromkeys(case.controller for case in cases))
    figure.set_size_inches(max(8.0, 2.2 * len(names)), 8.0)
    above, below = figure.subfigures(2, 1, height_ratios=(3, 2))
    trace: list[Any] = []
    runs.one(case, 0, law_file, outcomes.get((case.calibration, 0)), trace)
    _grasp(above.subplots(2, 1, sharex=True, height_ratios=(3, 1)), trace, CONTROLLERS[case.controller])
    limit_n = things(1, case.seed + case.pair)[0].limit_n
    above.axes[0].axhline(limit_n, color="tab:red", label="crushes")
    above.axes[0].legend(fontsize=7, loc="upper left")
    for axes, name in zip(below.subplots(1, len(names), sharey=True, squeeze=False)[0], names, strict=True):
        became: dict[str, list[tuple[float, float]]] = {"kept": [], "dropped": [], "crushed": []}
        for (tried, number), row in outcomes.items():
            if tried in cases and tried.controller == name and not tried.fault:
                thing = things(number + 1, tried.seed + tried.pair)[number]
                kind = "dropped" if row["dropped"] else "crushed" if row["crushed"] else "kept"
                became[kind].append((thing.friction, thing.limit_n / thing.worst_n))
        for (kind, where), marker, colour in zip(became.items(), ".vx", ("0.7", "C0", "C3"), strict=True):
            axes.scatter(*np.array(where).reshape(-1, 2).T, marker=marker, color=colour, s=18, label=kind)
        axes.set_title(CONTROLLERS[name], fontsize=8)
        axes.set_xlabel("friction")
    below.axes[0].set_ylabel("crush limit / worst need")
    below.axes[0].legend(fontsize=6)


def _grasp(axes: Any, trace: list[Any], felt_by: str) -> None:
    forces, flagged = axes
    t_s, applied, felt, need, flags, told = (np.array(column) for column in zip(*trace, strict=True))
    for line, values in (("applied", applied), (f"felt: {felt_by}", felt), ("needed in the air", need)):
        forces.plot(t_s, values, label=line, linewidth=1, linestyle="--" if values is need else "-")
    forces.vlines(t_s[told], 0, 0.3, color="tab:purple", label="SLIP")
    forces.set_ylabel("N on a side")
    seen = [flag for flag in FrameFlags if (flags & int(flag)).any()]
    for row, flag in enumerate(seen):
        flagged.fill_between(t_s, row, row + 0.8, where=flags & int(flag) != 0, step="mid")
    flagged.set_yticks([row + 0.4 for row in range(len(seen))], [str(flag.name) for flag in seen], fontsize=6)
    flagged.set_xlabel("s")
