"""Accuracy against cost: errors, host times, and counts of emulated boards, as a table and a picture.

The picture shows cycles per frame against the largest PoC error, one panel per core.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from biotac.markdown import table
from biotac.picture import picture

from .limit import QUANTITIES
from .measure import WEIGHT_NAMES, Facts

EVERYTHING = "everything"
DOUBLED = "everything, doubled"  # the same frames over the ADC's whole range

WEIGHTS = "compress n=1"  # a board's default
FLOOR_UM = 1e-4  # smaller errors are drawn here, with a note
PANELS = (("Cortex-M0+", ("m0plus", "m0plus_divider")), ("Cortex-M4F", ("m4f",)))
HIGHLIGHT = {"shipped": "#c2410c", "int + FPU": "#15803d"}
OTHER = "#334155"
LEFT = ("double",)  # labels stand to the right of their points and above, except these
BELOW = ("float mirrored", "divider", "gold int64", "double")


def facts(measured: Facts, cores: Facts) -> Facts:
    """The figures of measure(), with counts by core and scene beside each variant's errors; as JSON types.

    ``cores`` are boards.counts(), or empty.
    """
    variants: Facts = {}
    for name, by_weights in measured["variants"].items():
        variants[name] = {}
        for index, (weights, one) in enumerate(by_weights.items()):
            counts = {
                key: {scene: rows[index] for scene, rows in core["kernels"][name].items()}
                for key, core in cores.items()
            }
            variants[name][weights] = one | {"counts": counts}
    return measured | {
        "cores": {key: {word: core[word] for word in ("title", "cycles_by")} for key, core in cores.items()},
        "variants": variants,
        "scenes": {key: _scenes(core["kernels"], variants) for key, core in cores.items()},
        "exceptions": exceptions(measured),
    }


def _scenes(counted: Facts, variants: Facts) -> Facts:
    """What a board does around the kernel: title to one row for each kind of weights."""
    return {
        f"{title}, {scene}": rows
        for title, scenes in counted.items()
        if title not in variants
        for scene, rows in scenes.items()
    }


def exceptions(measured: Facts) -> list[str]:
    """Variants over the budget on the frames that it applies to, by name."""
    out = []
    for name, by_weights in measured["variants"].items():
        for weights, one in by_weights.items():
            for quantity, error in one["errors"].items():
                budget = measured["one_adc_step_at_1n"][weights][quantity] * measured["budget_share"]
                if error["at_1n"] > budget:
                    unit = QUANTITIES[quantity]
                    out.append(f"{name}, {weights}: {quantity} {error['at_1n']:.2g} {unit} of {budget:.2g} {unit}")
            denied = one["errors"]["PoC"]["unanswered"]
            if denied:
                out.append(f"{name}, {weights}: gives no point in {denied:.0%} of the random frames that have one")
    return out


def page(all_facts: Facts) -> str:
    """Markdown: a table for each kind of weights, the budget below it, and the exceptions."""
    effort = all_facts["effort"]
    lines = [
        "# Kernels: cost against accuracy",
        "",
        f"RMS and max over {effort['frames']} random frames of each of six classes; adv. is the worst that hill "
        f"climbing found, {effort['restarts']} restarts of {effort['steps']} steps. Host: a multiple of the shipped "
        "kernel's time, in this run. Cycles: with everything computed, the median of the counted frames (up to half of "
        "the ADC's range) and the longest of the same frames doubled. The point's error is a distance; that of force "
        "and of torque y, z is of the worst axis.",
    ]
    for weights in WEIGHT_NAMES.values():
        lines += ["", f"## Weights: {weights}", "", *_one_table(all_facts, weights)]
    lines += ["", f"## Beyond 1/{round(1 / all_facts['budget_share'])} of an ADC step at 1 N", ""]
    lines += [f"* {line}" for line in all_facts["exceptions"]] or ["None."]
    if all_facts["scenes"]:
        lines += ["", "## Whole rounds on the boards: cycles, longest", "", *_scene_table(all_facts)]
    for core in all_facts["cores"].values():
        lines += ["", f"{core['title']}: {core['cycles_by']}."]
    return "\n".join([*lines, ""])


def _scene_table(all_facts: Facts) -> list[str]:
    cores, scenes = all_facts["cores"], all_facts["scenes"]
    weights = list(WEIGHT_NAMES.values())
    head = ["scene", *(f"{core['title']}, {w}" for core in cores.values() for w in weights)]
    rows = []
    for scene in next(iter(scenes.values())):
        cells = (row for key in cores for row in scenes[key][scene])
        rows.append([scene, *(f"{row['cycles']}, {row['cycles_max']}" for row in cells)])
    return table(head, rows)[:-1]


def _one_table(all_facts: Facts, weights: str) -> list[str]:
    cores = all_facts["cores"]
    step = all_facts["one_adc_step_at_1n"][weights]
    head = ["variant", *(f"{core['title']}: cycles, longest (instr.)" for core in cores.values()), "host"]
    head += [f"{quantity} RMS / max / adv. [{unit}]" for quantity, unit in QUANTITIES.items()]
    rows = []
    for name, by_weights in all_facts["variants"].items():
        one = by_weights[weights]
        cells = [name]
        for key in cores:
            counted = one["counts"][key]
            cycles, instructions = counted[EVERYTHING]["cycles"], counted[EVERYTHING]["instructions"]
            longest = counted.get(DOUBLED, counted[EVERYTHING])["cycles_max"]
            cells.append(f"{cycles}, {max(longest, cycles)} ({instructions})")
        cells.append(f"{one['host_times_shipped']:.2f}")
        for quantity in QUANTITIES:
            error = one["errors"][quantity]
            cells.append(f"{error['rms']:.2g} / {error['max']:.2g} / {error['adversarial']:.2g}")
        rows.append(cells)
    blank = [""] * (len(cores) + 1)
    rows.append(["one ADC step at 1 N, RMS", *blank, *(f"{step[q]:.2g}" for q in QUANTITIES)])
    share = all_facts["budget_share"]
    rows.append([f"1/{round(1 / share)} of it", *blank, *(f"{step[q] * share:.2g}" for q in QUANTITIES)])
    return table(head, rows)[:-1]


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
    axes.set(xscale="log", yscale="log", xlabel="cycles per frame, everything computed", title=title)
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
    """A line through the variants that no other beats in both error and cycles."""
    best: list[tuple[int, float]] = []
    for _, cycles, error_um in sorted(points, key=lambda point: (point[1], point[2])):
        if not best or error_um < best[-1][1]:
            best.append((cycles, max(error_um, FLOOR_UM)))
    axes.step([c for c, _ in best], [e for _, e in best], where="post", color="#94a3b8", linewidth=1, zorder=0)
