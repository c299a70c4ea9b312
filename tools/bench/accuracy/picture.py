"""The front as a picture: cycles per frame against the largest PoC error, a panel per core."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from biotac.picture import picture

from .front import EVERYTHING, Facts

WEIGHTS = "compress n=1"  # what a board starts with
FLOOR_UM = 1e-4  # smaller errors are drawn here, and said
PANELS = (("Cortex-M0+", ("m0plus", "m0plus_divider")), ("Cortex-M4F", ("m4f",)))
HIGHLIGHT = {"shipped": "#c2410c", "int + FPU": "#15803d"}
OTHER = "#334155"
LEFT = ("double",)  # labels stand right of their points and above, but for these
BELOW = ("float mirrored", "divider", "gold int64", "double")


def draw(all_facts: Facts, path: Path) -> None:
    """Write a PNG. The facts must have counts."""
    with picture(path) as figure:
        figure.set_size_inches(13, 6)
        figure.suptitle(f"Cost of one frame against its largest PoC error (weights: {WEIGHTS})")
        axes = figure.subplots(1, 2, sharey=True)
        for panel, (title, keys) in zip(axes, PANELS, strict=True):
            _panel(panel, all_facts, title, keys)
        axes[0].set_ylabel("largest PoC error, random and adversarial frames [um]")


def _panel(axes: Any, all_facts: Facts, title: str, keys: tuple[str, ...]) -> None:
    points = [_point(all_facts, name, keys[0]) for name in all_facts["variants"]]
    _limits(axes, all_facts)
    _staircase(axes, points)
    for name, cycles, error_um in points:
        color = HIGHLIGHT.get(name, OTHER)
        axes.plot(cycles, max(error_um, FLOOR_UM), "o" if error_um >= FLOOR_UM else "v", color=color, markersize=9)
        _label(axes, f"{name}: {cycles:,} cycles, {_um(error_um)}", (cycles, max(error_um, FLOOR_UM)), color, name)
    for key in keys[1:]:
        if key in all_facts["cores"]:
            name, cycles, error_um = _point(all_facts, "shipped", key)
            axes.plot(cycles, error_um, "o", markerfacecolor="white", color=HIGHLIGHT[name], markersize=9)
            _label(axes, f"with the RP2040's divider: {cycles:,}", (cycles, error_um), HIGHLIGHT[name], "divider")
    cycles_of = [cycles for _, cycles, _ in points]
    axes.set(xscale="log", yscale="log", xlabel="cycles per frame, everything wanted", title=title)
    axes.set_xlim(min(cycles_of) / 1.6, max(cycles_of) * 2.5)
    axes.set_ylim(FLOOR_UM / 4, max(error_um for *_, error_um in points) * 6)
    axes.grid(alpha=0.25, which="major")


def _label(axes: Any, text: str, at: tuple[float, float], color: str, name: str) -> None:
    across, side = (-8, "right") if name in LEFT else (8, "left")
    up, edge = (-6, "top") if name in BELOW else (3, "bottom")
    axes.annotate(text, at, xytext=(across, up), textcoords="offset points", fontsize=8.5, color=color, ha=side,
                  va=edge, bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none"})  # fmt: skip


def _point(all_facts: Facts, name: str, key: str) -> tuple[str, int, float]:
    one = all_facts["variants"][name][WEIGHTS]
    error = one["errors"]["PoC"]
    return name, one["counts"][key][EVERYTHING]["cycles"], max(error["max"], error["adversarial"])


def _um(value: float) -> str:
    return f"{value:.2g} um" if value < 100 else f"{value:,.0f} um"


def _limits(axes: Any, all_facts: Facts) -> None:
    step_um = all_facts["one_adc_step_at_1n"][WEIGHTS]["PoC"]
    share = all_facts["budget_share"]
    for value, said in (
        (step_um, f"one step of the ADC at 1 N: {step_um:.0f} um RMS"),
        (step_um * share, f"1/{round(1 / share)} of it: {step_um * share:.1f} um"),
    ):
        axes.axhline(value, color="#7c3aed", linewidth=1.2, linestyle="--")
        axes.annotate(said, (0.99, value), xycoords=("axes fraction", "data"), xytext=(0, 3),
                      textcoords="offset points", fontsize=8.5, color="#7c3aed", ha="right")  # fmt: skip


def _staircase(axes: Any, points: list[tuple[str, int, float]]) -> None:
    """Through those that nobody beats in both."""
    best: list[tuple[int, float]] = []
    for _, cycles, error_um in sorted(points, key=lambda point: (point[1], point[2])):
        if not best or error_um < best[-1][1]:
            best.append((cycles, max(error_um, FLOOR_UM)))
    axes.step([c for c, _ in best], [e for _, e in best], where="post", color="#94a3b8", linewidth=1, zorder=0)
