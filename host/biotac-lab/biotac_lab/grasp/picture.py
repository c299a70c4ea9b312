"""A picture of one grasp, and of how many things each controller dropped and crushed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..report import Facts
from . import runs
from .plant import items
from .runs import CONTROLLERS, TRUE, Case


def draw(figure: Any, cases: list[Case], outcomes: dict[tuple[Case, int], Facts], law_file: Path | None) -> None:
    """Above, a grasp of the first thing, by a board if one was tried; below, the losses of each controller."""
    case = next((case for case in cases if case.controller not in TRUE), cases[0])
    bars = list(dict.fromkeys((case.plant, case.controller) for case in cases))
    figure.set_size_inches(10.0, 4.2 + 0.35 * len(bars))
    above, below = figure.subplots(2, 1, height_ratios=(10, 2 + len(bars)))
    trace: list[Any] = []
    runs.run_trial(case, 0, law_file, outcomes.get((case.calibration, 0)), trace)
    _grasp(above, trace, f"{CONTROLLERS[case.controller]}, {case.plant} plant")
    above.axhline(items(1, case.seed + case.pair)[0].limit_n, color="tab:red", label="crushes")
    above.legend(fontsize=8, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=5, frameon=False)
    for bar in reversed(bars):
        tried = [case for case in cases if (case.plant, case.controller) == bar and not case.fault]
        rows = [row for (case, _), row in outcomes.items() if case in tried]
        left, label = 0.0, f"{bar[0]}: {CONTROLLERS[bar[1]]}"
        for kind, colour in (("dropped", "C0"), ("crushed", "C3")):
            percent = 100.0 * float(np.mean([row[kind] for row in rows]))
            below.barh(label, percent, left=left, color=colour, label=kind if bar == bars[-1] else None)
            left += percent
        below.text(left + 1, label, f"{left:.0f} % of {len(rows)}", va="center", fontsize=8)
    below.set(xlim=(0, 110), xlabel="lost [%] of simulated things, by plant and what the controller is told")
    below.legend(fontsize=8, loc="lower right")


def _grasp(axes: Any, trace: list[Any], felt_by: str) -> None:
    t_s, applied, felt, need, _, reported = (np.array(column) for column in zip(*trace, strict=True))
    for label, values, style in ((f"felt: {felt_by}", felt, "-"), ("applied", applied, "-"), ("needed", need, "--")):
        axes.plot(t_s, values, style, label=label, linewidth=1.2)
    axes.vlines(t_s[reported], 0, 0.5, color="tab:purple", linewidth=2, label="SLIP reported")
    axes.set(xlabel="time [s]", ylabel="force on each side [N]")
