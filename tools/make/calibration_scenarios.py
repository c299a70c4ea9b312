#!/usr/bin/env python3
"""Write the bundled scenarios that calibrate a finger: everywhere, everywhere but in some places, and by weights.

tools/make/calibration_scenarios.py           write them
tools/make/calibration_scenarios.py --check   exit 1 when one has drifted
"""

from __future__ import annotations

import math
import random
import sys

from biotac.calibrate.press import weights
from biotac.core.geometry import RADIUS_MM
from committed import ROOT, write_or_check

FOLDER = ROOT / "host" / "biotac" / "sim" / "scenarios"

# Degrees around the finger (0: the pad's middle, positive: E11's side) and mm along it; degrees towards it on the tip.
SIDES = {"E1's side": (-68.0, -42.0), "pad": (-15.0, 15.0), "E11's side": (42.0, 68.0)}
ALONG_MM = (-12.0, -8.5, -5.0, -1.5)
TIP_AROUND, TIP_UP = (-55.0, -18.0, 18.0, 55.0), (17.0, 48.0)
TURNS = 2  # every place twice, in another order and with another force


def places(without: tuple[str, ...]) -> list[tuple[float, float]]:
    """x and y in mm of every place that is pressed."""
    found = []
    for side, angles in SIDES.items():
        if side not in without:
            found += [(x, RADIUS_MM * math.sin(math.radians(a))) for x in ALONG_MM for a in angles]
    for up in (math.radians(u) for u in TIP_UP):
        for around in (math.radians(a) for a in TIP_AROUND):
            if "tip" not in without:
                found.append((RADIUS_MM * math.sin(up), RADIUS_MM * math.cos(up) * math.sin(around)))
    return found


def scenario(name: str, words: str, without: tuple[str, ...] = (), *, shear_to_tip: bool = True) -> str:
    """The TOML text, the same on every run."""
    rng = random.Random(6)
    # Three degrees in the first 40 s, which is too much drift to begin with; then a minute of quiet.
    steps = [
        "{do = 'temperature', seconds = 0.1, celsius = 27.0}",
        "{do = 'temperature', seconds = 40.0, celsius = 30.0}",
        "{do = 'rest', seconds = 75.0}",
    ]
    for turn in range(TURNS):
        spots = places(without)
        rng.shuffle(spots)
        for x, y in spots:
            steps += contact(rng, x, y, turn, shear_to_tip=shear_to_tip)
    lines = [f"# {line}" for line in (*words.splitlines(), "Made by tools/make/calibration_scenarios.py.")]
    lines += [f'name = "{name}"', "seed = 6", "step = ["]
    return "\n".join([*lines, *(f"  {step}," for step in steps), "]", ""])


def contact(rng: random.Random, x: float, y: float, turn: int, *, shear_to_tip: bool) -> list[str]:
    """A press with shears and twists; times vary, as a hand's do."""
    force = rng.uniform(1.5, 3.5) if turn == 0 else rng.uniform(4.0, 7.0)

    def after(do: str) -> str:
        return f"{do}, seconds = {rng.uniform(0.15, 0.35):.2f}}}"

    shear = 0.35 * force
    steps = [
        after(f"{{do = 'press', at_mm = [{x:.3f}, {y:.3f}], tip_mm = 4.0, force_n = {force:.2f}"),
        after("{do = 'hold'"),
    ]
    ways = [(1, 0), (-1, 0), (0, 1), (0, -1)] if shear_to_tip else [(-1, 0), (0, 1), (0, -1)]
    rng.shuffle(ways)
    for to_tip, to_side in ways:
        size = shear * rng.uniform(0.8, 1.2)
        steps += [
            after(f"{{do = 'shear', shear_n = [{to_tip * size:.2f}, {to_side * size:.2f}]"),
            after("{do = 'hold'"),
        ]
    steps.append(after("{do = 'shear', shear_n = [0.0, 0.0]"))
    twist = rng.uniform(3.0, 6.0)
    for way in rng.sample([1, -1], 2):
        steps += [after(f"{{do = 'twist', torsion_nmm = {way * twist:.2f}"), after("{do = 'hold'")]
    if shear_to_tip:
        # both at once, which is what the paper's scales cannot tell apart
        both = [round(rng.uniform(-shear, shear), 2) for _ in range(2)]
        steps.append(after(f"{{do = 'shear', shear_n = {both}"))
    steps += [after("{do = 'press', force_n = 0.0"), f"{{do = 'rest', seconds = {rng.uniform(0.7, 1.6):.2f}}}"]
    return steps


def weighed() -> str:
    """A finger under the loads that `biotac calibrate press --weights` asks for, at several places along the pad."""
    lines = [
        "# Weights on a finger's pad, its block tilted to all sides, as `biotac calibrate press --weights` asks.",
        "# Made by tools/make/calibration_scenarios.py.",
        'name = "weights"',
        "seed = 3",
        "step = [",
        "  {do = 'rest', seconds = 1.5},",
    ]
    for k, load in enumerate(weights.plan(weights.MASSES_G, weights.TILTS_DEG)):
        x, y, z = (load.size_n * part for part in load.toward)
        at_mm = ALONG_MM[k % len(ALONG_MM)]
        lines += [
            # Sheared while barely touched, so that what follows is one load that rises, holds still and falls.
            f"  {{do = 'press', at_mm = [{at_mm}, 0.0], tip_mm = 4.0, force_n = 0.05, seconds = 0.05}},",
            f"  {{do = 'shear', shear_n = [{x:.4f}, {y:.4f}], seconds = 0.05}},",
            f"  {{do = 'press', force_n = {z:.4f}, seconds = 0.4}},",
            "  {do = 'hold', seconds = 1.4},",
            "  {do = 'press', force_n = 0.0, seconds = 0.3},",
            "  {do = 'rest', seconds = 1.5},",
        ]
    return "\n".join([*lines, "]", ""])


def main() -> int:
    """Write or check all."""
    everywhere = scenario(
        "calibrate",
        "A finger warms up, is left alone, and is then pressed, sheared and twisted in 32 places, each twice: what a\n"
        "calibration needs (`biotac calibrate wrench --live`).",
    )
    with_gaps = scenario(
        "calibrate_gaps",
        "The same without E11's side, and without any shear to the tip: a calibration that is not complete.",
        ("E11's side",),
        shear_to_tip=False,
    )
    files = {FOLDER / "calibrate.toml": everywhere, FOLDER / "calibrate_gaps.toml": with_gaps}
    files[FOLDER / "weights.toml"] = weighed()
    return write_or_check(files, "tools/make/calibration_scenarios.py")


if __name__ == "__main__":
    sys.exit(main())
