"""The front of accuracy against cost: errors and host times, and what emulated boards counted, as one table."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from biotac.markdown import table

from . import limit
from .measure import QUANTITIES, WEIGHT_NAMES, Outcome

EVERYTHING = "everything"
DOUBLED = "everything, doubled"  # the same frames over the ADC's whole range

Facts = dict[str, Any]


def facts(outcome: Outcome, cores: Facts) -> Facts:
    """Everything as JSON: variants by name and weights, each with errors, host time and counts by core.

    ``cores`` are boards.counts(), or empty.
    """
    variants: Facts = {}
    for name, by_weights in outcome.variants.items():
        variants[name] = {}
        for index, (weights, measured) in enumerate(by_weights.items()):
            on_cores = {
                key: {scene: rows[index] for scene, rows in core["kernels"][name].items()}
                for key, core in cores.items()
            }
            variants[name][weights] = {
                "host_times_shipped": measured.times_shipped,
                "errors": {quantity: asdict(error) for quantity, error in measured.errors.items()},
                "counts": on_cores,
            }
    return {
        "effort": asdict(outcome.effort),
        "quantities": QUANTITIES,
        "one_adc_step_at_1n": outcome.limits,
        "budget_share": limit.BUDGET_SHARE,
        "cores": {key: {word: core[word] for word in ("title", "cycles_by")} for key, core in cores.items()},
        "variants": variants,
        "scenes": {key: _scenes(core["kernels"], outcome) for key, core in cores.items()},
        "exceptions": exceptions(outcome),
    }


def _scenes(counted: Facts, outcome: Outcome) -> Facts:
    """What a board does around the kernel: title to a row for each kind of weights."""
    return {
        f"{title}, {scene}": rows
        for title, scenes in counted.items()
        if title not in outcome.variants
        for scene, rows in scenes.items()
    }


def exceptions(outcome: Outcome) -> list[str]:
    """Who does not keep the budget on the frames that it is for, by name."""
    out = []
    for name, by_weights in outcome.variants.items():
        for weights, measured in by_weights.items():
            for quantity, error in measured.errors.items():
                budget = outcome.budget(weights, quantity)
                if error.at_1n > budget:
                    unit = QUANTITIES[quantity]
                    out.append(f"{name}, {weights}: {quantity} {error.at_1n:.2g} {unit} of {budget:.2g} {unit}")
            denied = measured.errors["PoC"].unanswered
            if denied:
                out.append(f"{name}, {weights}: gives no point in {denied:.0%} of the random frames that have one")
    return out


def page(all_facts: Facts) -> str:
    """Markdown: a table per kind of weights, the budget under it, and the exceptions."""
    effort = all_facts["effort"]
    lines = [
        "# Kernels: cost against accuracy",
        "",
        f"RMS and max over {effort['frames']} random frames of each of six classes; adv. is the worst that hill "
        f"climbing found, {effort['restarts']} restarts of {effort['steps']} steps. Host: times the shipped kernel's "
        "time, within this run. Cycles: everything wanted, the median of the counted frames (up to half of the ADC's "
        "range) and the longest of the same frames doubled. The point's error is a distance, that of force and of "
        "torque y, z is of the axis that is furthest off.",
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
