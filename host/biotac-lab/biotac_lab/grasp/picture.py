"""Pictures of one grasp and of what became of all things, over friction and fragility."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from biotac import FrameFlags

from ..report import Facts
from . import runs
from .plant import things
from .runs import CONTROLLERS, Case


def draw(figure: Any, outcomes: dict[Case, list[Facts]], made: dict[Case, Any], law_file: Path) -> None:
    """Above a grasp of the first thing, by a board if one was tried; below, a panel for each controller."""
    cases = [case for case in outcomes if not case.fault]
    names = list(dict.fromkeys(case.controller for case in cases))
    figure.set_size_inches(max(8.0, 2.6 * len(names)), 8.0)
    above, below = figure.subfigures(2, 1, height_ratios=(3, 2))
    case = next((case for case in cases if case.controller not in runs.TRUE), cases[0])
    _grasp(above, case, law_file, made[case])
    for axes, name in zip(below.subplots(1, len(names), sharey=True, squeeze=False)[0], names, strict=True):
        _outcomes(axes, {case: rows for case, rows in outcomes.items() if case.controller == name and not case.fault})
        axes.set_title(CONTROLLERS[name], fontsize=9)


def _grasp(figure: Any, case: Case, law_file: Path, made: Any) -> None:
    trace: list[Any] = []
    runs.one(case, 0, law_file, made, trace)
    t_s, applied, felt, need, flags, told = (np.array(column) for column in zip(*trace, strict=True))
    forces, flagged = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    limit_n = things(1, case.seed + case.pair)[0].limit_n
    forces.plot(t_s, applied, label="applied")
    forces.plot(t_s, felt, label=f"felt: {CONTROLLERS[case.controller]}", linewidth=1)
    forces.plot(t_s, need, "k--", label="needed in the air", linewidth=1)
    forces.axhline(limit_n, color="tab:red", label="crushes")
    forces.vlines(t_s[told], 0, 0.1 * limit_n, color="tab:purple", label="SLIP")
    forces.set_ylabel("N on a side")
    forces.legend(fontsize=7, loc="upper left")
    seen = [flag for flag in FrameFlags if (flags & int(flag)).any()]
    for row, flag in enumerate(seen):
        flagged.fill_between(t_s, row, row + 0.8, where=flags & int(flag) != 0, step="mid")
    flagged.set_yticks([row + 0.4 for row in range(len(seen))], [str(flag.name) for flag in seen], fontsize=6)
    flagged.set_xlabel("s")


def _outcomes(axes: Any, outcomes: dict[Case, list[Facts]]) -> None:
    places: dict[str, list[tuple[float, float]]] = {"kept": [], "dropped": [], "crushed": []}
    for case, rows in outcomes.items():
        for thing, row in zip(things(len(rows), case.seed + case.pair), rows, strict=True):
            worst_n = (thing.mass_kg + thing.added_kg) * 9.81 / (2 * thing.friction)
            became = "dropped" if row["dropped"] else "crushed" if row["crushed"] else "kept"
            places[became].append((thing.friction, thing.limit_n / worst_n))
    for (became, where), marker, colour in zip(places.items(), ".vx", ("0.7", "tab:blue", "tab:red"), strict=True):
        axes.scatter(*np.array(where).reshape(-1, 2).T, marker=marker, color=colour, s=18, label=became)
    axes.set_xlabel("friction")
    axes.set_ylabel("crush limit / worst need")
    axes.legend(fontsize=6)
