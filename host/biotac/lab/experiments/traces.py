"""Traces of a trial over time: electrodes on top, what was applied against what models say below."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...core.geometry import Floats
from ...wire import sensor_gen as _sensor
from .estimates import PAPER, Estimate
from .trial import Trial

MAP_COLORS = ("#1d4ed8", "#15803d", "#7c3aed", "#be185d")
PAPER_COLOR = "#c2410c"
OTHER_PAPER_COLOR = "#fb923c"
MAX_POINTS = 20_000  # a line; more only make the picture larger


@dataclass(frozen=True)
class Panel:
    """One quantity over time: ``truth`` (n,) or None, and models' ``lines`` (n,) by name."""

    label: str
    truth: Floats | None
    lines: dict[str, Floats]


def panels(trial: Trial, estimates: Sequence[Estimate], axes: Sequence[str]) -> list[Panel]:
    """Those of Fx, Fy, Fz, Mz and "torsion" (about the contact's normal, at the true contact) that are known."""
    result = []
    for axis in axes:
        lines: dict[str, Floats] = {}
        truth: Floats | None = None
        for its in estimates:
            values = _values(trial, its, axis)
            if values is not None:
                lines[its.name] = values
        if axis.startswith("F"):
            truth = None if trial.force_n is None else trial.force_n[:, "xyz".index(axis[1])]
        elif axis == "Mz":
            truth = None if trial.torque_nmm is None else trial.torque_nmm[:, 2]
        else:
            truth = trial.torsion_nmm
        unit = "N" if axis.startswith("F") else "N mm"
        result.append(Panel(f"{axis} [{unit}]", truth, lines))
    return result


def _values(trial: Trial, its: Estimate, axis: str) -> Floats | None:
    if axis.startswith("F"):
        column: Floats = its.force_n[:, "xyz".index(axis[1])]
        return column
    if its.torque_nmm is None:
        return None
    if axis == "Mz":
        about: Floats = its.torque_nmm[:, 2]
        return about
    return None if trial.at_mm is None else its.torsion_nmm(trial.at_mm)


def draw(trial: Trial, below: Sequence[Panel], title: str, path: Path, marked: Sequence[str]) -> None:
    """Write a PNG; electrodes in ``marked`` are in colour, the others grey."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    ratios = [1.6] + [1.0] * len(below)
    figure, axes = plt.subplots(len(below) + 1, 1, figsize=(13, 2.4 * sum(ratios) / 1.15), sharex=True,
                                height_ratios=ratios, layout="constrained")  # fmt: skip
    figure.suptitle(title)
    _electrodes(axes[0], trial, marked)
    for axis, panel in zip(axes[1:], below, strict=True):
        _panel(axis, trial, panel)
    for axis in axes:
        _phases(axis, trial, named=axis is axes[0])
        axis.grid(alpha=0.25)
        axis.margins(x=0.0)
    axes[-1].set_xlabel("time [s]")
    figure.savefig(path, dpi=100)
    plt.close(figure)


def _electrodes(axes: Any, trial: Trial, marked: Sequence[str]) -> None:
    step = max(1, len(trial) // MAX_POINTS)
    colors = iter(("#c2410c", "#f59e0b", "#1d4ed8", "#60a5fa", "#15803d", "#7c3aed"))
    for name, line in zip(_sensor.ELECTRODE_NAMES, trial.signal.T, strict=True):
        if name not in marked:
            axes.plot(trial.time_s[::step], line[::step], color="#9ca3af", linewidth=0.6, alpha=0.8)
    for name in marked:
        line = trial.signal[:, _sensor.ELECTRODE_NAMES.index(name)]
        axes.plot(trial.time_s[::step], line[::step], color=next(colors), linewidth=1.1, label=name)
    axes.set_ylabel("count above tare")
    _legend(axes)


def _panel(axes: Any, trial: Trial, panel: Panel) -> None:
    step = max(1, len(trial) // MAX_POINTS)
    if panel.truth is not None:
        axes.plot(trial.time_s[::step], panel.truth[::step], color="#111111", linewidth=3, alpha=0.3, label="applied")
    colors = iter(MAP_COLORS)
    papers = iter((PAPER_COLOR, OTHER_PAPER_COLOR))
    for name, line in panel.lines.items():
        of_paper = name.startswith(PAPER)
        color = next(papers, PAPER_COLOR) if of_paper else next(colors, MAP_COLORS[-1])
        # a map follows every count's noise: drawn last, its line would hide the others
        axes.plot(trial.time_s[::step], line[::step], color=color, linewidth=1.0, label=name, zorder=3 + of_paper)
    axes.axhline(0.0, color="#111111", linewidth=0.6)
    axes.set_ylabel(panel.label)
    _legend(axes)


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
