"""The front as a picture: cycles of a force against its held-out error on real fingers, a panel per core."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...picture import picture
from .newtons import OWN, Outcome, Point

PANELS = (("Cortex-M0+", "m0plus_divider", "with the RP2040's divider"), ("Cortex-M4F", "m4f", ""))
COLORS = {"nothing": "#c2410c", OWN: "#1d4ed8"}
LITTLE = "#15803d"
# Names stand right of their points and above, but for these.
LEFT = ("affine", "small map", "population map")
BELOW = ("Lin's scales, the firmware's", "small map", "joined map", "population map, pulled")
FLOORS = (("repeatability_n", "the plate again, same pattern", "--"), ("noise_n", "electrode noise, a frame", ":"))


def draw(its: Outcome, path: Path) -> None:
    """Write a PNG."""
    with picture(path) as figure:
        figure.set_size_inches(13, 6)
        files = ", ".join(its.noise_n)
        figure.suptitle(f"Force on a real finger: cycles against error that was not trained on ({files})")
        axes = figure.subplots(1, 2, sharey=True)
        for panel, (title, core, words) in zip(axes, PANELS, strict=True):
            _panel(panel, its, core)
            panel.set(title=title, xlabel=f"cycles for one force{', ' if words else ''}{words}")
        axes[0].set_ylabel("RMS length of the force's error [N]")
        figure.legend(*axes[0].get_legend_handles_labels(), fontsize=9, loc="outside lower center", ncols=3)


def _panel(axes: Any, its: Outcome, core: str) -> None:
    for field, words, style in FLOORS:
        level = _mean([float(np.linalg.norm(three)) for three in getattr(its, field).values()])
        axes.axhline(level, color="#334155", linestyle=style, linewidth=1, label=f"{words}: {level:.2f} N")
    seen = set()
    for point in its.points:
        color = COLORS.get(point.knows, LITTLE)
        words = point.knows if point.knows in COLORS else "a little"
        label = None if words in seen else f"known of the finger: {words}"
        seen.add(words)
        x = point.cycles[core]
        axes.plot(x, point.error_n, "o", color=color, markersize=9, label=label)
        for rmse in point.rmse_n.values():
            axes.plot(x, np.linalg.norm(rmse), "_", color=color, markersize=9, alpha=0.6)
        _name(axes, point, x, color)
    axes.set(xscale="log", yscale="log")
    cycles = [point.cycles[core] for point in its.points]
    axes.set_xlim(min(cycles) / 1.6, max(cycles) * 14)
    axes.grid(alpha=0.25, which="both")


def _name(axes: Any, point: Point, x: int, color: str) -> None:
    below, left = point.name in BELOW, point.name in LEFT
    axes.annotate(
        f"{point.name}: {x:,}, {point.error_n:.2f} N",
        (x, point.error_n),
        xytext=(-8 if left else 8, -12 if below else 4),
        textcoords="offset points",
        fontsize=8,
        color=color,
        ha="right" if left else "left",
        va="top" if below else "bottom",
    )


def _mean(values: list[float]) -> float:
    return float(np.exp(np.mean(np.log(values))))
