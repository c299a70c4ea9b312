"""Traces of a trial over time: electrodes on top; below, the applied load against the models' estimates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from biotac.wire import sensor

from .estimates import PAPER, Estimate
from .trial import Floats, Trial

MAP_COLORS = ("#1d4ed8", "#15803d", "#7c3aed", "#be185d")
PAPER_COLOR = "#c2410c"
OTHER_PAPER_COLOR = "#fb923c"
MAX_POINTS = 20_000  # per line; more would only make the picture larger


def draw(
    trial: Trial, estimates: Sequence[Estimate], axes: Sequence[str], title: str, figure: Any, marked: Sequence[str]
) -> None:
    """``axes`` are some of Fx, Fy, Fz, Mz and "torsion" (about the contact's normal, at the true contact).

    Electrodes in ``marked`` are drawn in colour, the others in grey.
    """
    ratios = [1.6] + [1.0] * len(axes)
    figure.set_size_inches(13, 2.4 * sum(ratios) / 1.15)
    figure.suptitle(title)
    panels = figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios)
    _electrodes(panels[0], trial, marked)
    for panel, axis in zip(panels[1:], axes, strict=True):
        _quantity(panel, trial, estimates, axis)
    for panel in panels:
        _phases(panel, trial, named=panel is panels[0])
        panel.grid(alpha=0.25)
        panel.margins(x=0.0)
    panels[-1].set_xlabel("time [s]")


def _electrodes(axes: Any, trial: Trial, marked: Sequence[str]) -> None:
    step = max(1, len(trial) // MAX_POINTS)
    colors = iter(("#c2410c", "#f59e0b", "#1d4ed8", "#60a5fa", "#15803d", "#7c3aed"))
    for name, line in zip(sensor.ELECTRODE_NAMES, trial.signal.T, strict=True):
        if name not in marked:
            axes.plot(trial.time_s[::step], line[::step], color="#9ca3af", linewidth=0.6, alpha=0.8)
    for name in marked:
        line = trial.signal[:, sensor.ELECTRODE_NAMES.index(name)]
        axes.plot(trial.time_s[::step], line[::step], color=next(colors), linewidth=1.1, label=name)
    axes.set_ylabel("counts above tare")
    _legend(axes)


def _quantity(panel: Any, trial: Trial, estimates: Sequence[Estimate], axis: str) -> None:
    step = max(1, len(trial) // MAX_POINTS)
    truth = _axis(axis, trial.force_n, trial.torque_nmm, trial.torsion_nmm)
    if truth is not None and np.isfinite(truth).any():
        panel.plot(trial.time_s[::step], truth[::step], color="#111111", linewidth=3, alpha=0.3, label="applied")
    colors = iter(MAP_COLORS)
    papers = iter((PAPER_COLOR, OTHER_PAPER_COLOR))
    for trace in estimates:
        at_contact = None if trace.torque_nmm is None else trace.torsion_nmm(trial.at_mm)
        line = _axis(axis, trace.force_n, trace.torque_nmm, at_contact)
        if line is None:
            continue
        is_paper = trace.name.startswith(PAPER)
        color = next(papers, PAPER_COLOR) if is_paper else next(colors, MAP_COLORS[-1])
        # a map's line follows the noise of every count: drawn last, it would hide the others
        panel.plot(
            trial.time_s[::step], line[::step], color=color, linewidth=1.0, label=trace.name, zorder=3 + is_paper
        )
    panel.axhline(0.0, color="#111111", linewidth=0.6)
    panel.set_ylabel(f"{axis} [{'N' if axis.startswith('F') else 'N mm'}]")
    _legend(panel)


def _axis(axis: str, force_n: Floats | None, torque_nmm: Floats | None, torsion_nmm: Floats | None) -> Floats | None:
    if axis == "torsion":
        return torsion_nmm
    values = force_n if axis.startswith("F") else torque_nmm
    return None if values is None else values[:, "xyz".index(axis[1])]


def _legend(axes: Any) -> None:
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.005, 0.5))


def _phases(axes: Any, trial: Trial, *, named: bool) -> None:
    start = 0.0
    for k, phase in enumerate(trial.phases):
        if k % 2:
            axes.axvspan(start, phase.end_s, color="#0f172a", alpha=0.05, linewidth=0)
        if named:
            axes.annotate(phase.name.replace(" ", "\n"), (np.mean([start, phase.end_s]), 1.0),
                          xycoords=("data", "axes fraction"), xytext=(0, 3), textcoords="offset points", ha="center",
                          fontsize=8 if len(trial.phases) < 10 else 6.5)  # fmt: skip
        start = phase.end_s
