"""The shear trial: Lin, Fishel and Loeb 2013, figure 3, phases A to G.

A 500 g weight with a flat surface lies on the pad and is pushed by hand to E11's side, then to E1's, about
3 N each. The paper shows electrodes and says in words what they do; those words are the checks.
"""

from __future__ import annotations

from pathlib import Path

from ...sim.physics import Profile
from . import traces, weight
from .outcome import Facts, Options, claim, table, text
from .trial import Trial, play
from .weight import Result

RECORDING = "E and F"
MAPS = True

SHEAR_N = 3.0
HOLD_S = 2.5
LATERAL = ("E1", "E4", "E11", "E14")
MARKED = (*LATERAL, "E17")
# phase, weight, push to +y
PHASES = (("B", 1.0, 0.0), ("C", 1.0, 1.0), ("D", 1.0, 0.0), ("E", 1.0, -1.0), ("F", 1.0, 0.0), ("G", 0.0, 0.0))


def emulated(
    seed: int, profile: Profile = "new", *, take: int = 0, noiseless: bool = False, mirrored: bool = False
) -> Trial:
    """Figure 3 on an emulated finger; ``mirrored`` is the same trial as its mirror image sees it."""
    side = -1.0 if mirrored else 1.0
    steps = [
        (name, weight.pose(force_n=load * weight.WEIGHT_N, shear_y_n=side * push * SHEAR_N))
        for name, load, push in PHASES
    ]
    script = weight.script(weight.pose(), steps, HOLD_S)
    return play("figure 3", script, seed=seed, profile=profile, take=take, noiseless=noiseless, mirrored=mirrored)


def run(options: Options) -> Result:
    """On an emulated finger or a recording."""
    if options.recording is not None:
        return weight.of_recording(options, torque=False)
    notes = [f"emulated sensor, new, seed {options.seed}: {weight.WEIGHT_N:.1f} N over E17, pushed with {SHEAR_N:g} N"]
    source = f"emulated finger, seed {options.seed}"
    return weight.estimated(source, emulated(options.seed), options, notes, is_recorded=False)


def facts(result: Result) -> Facts:
    """Errors, phases, and what the paper's caption says."""
    its = weight.facts_of(result, "shear")
    if not result.is_recorded:
        its["checks"] = _claims({phase["name"]: phase["counts"] for phase in its["phases"]})
    return its


def _claims(counts: dict[str, dict[str, float]]) -> list[Facts]:
    """Figure 3's caption, from mean counts above tare by phase and electrode."""

    def pushed(phase: str, before: str, name: str) -> float:
        return counts[phase][name] - counts[before][name]

    towards = {name: pushed("C", "B", name) for name in LATERAL}
    away = {name: pushed("E", "D", name) for name in LATERAL}
    opposed = all((move["E1"] > 0) != (move["E11"] > 0) and (move["E4"] > 0) != (move["E14"] > 0)
                  for move in (towards, away))  # fmt: skip
    return [
        claim("E1, E4, E11 and E14 rise in B, as liquid is displaced towards them",
              all(counts["B"][name] > 0 for name in LATERAL)),
        claim("E17, under the weight, is reduced from B to F", all(counts[phase]["E17"] < 0 for phase in "BCDEF")),
        claim("E1 and E4 change one way in C and the other in E",
              all((towards[name] > 0) != (away[name] > 0) for name in ("E1", "E4"))),
        claim("E11 and E14, on the opposite side, change reciprocally", opposed),
    ]  # fmt: skip


def page(facts: Facts) -> list[str]:
    """Errors, then electrodes and forces by phase."""
    lines = weight.errors_table(facts)
    if not facts["phases"]:
        return lines
    rows = [[phase["name"], *[text(phase["counts"][name], 1) for name in MARKED]] for phase in facts["phases"]]
    lines += ["## Electrodes of figure 3", "", "Mean counts above the tare.", "", *table(["phase", *MARKED], rows)]
    return [*lines, "## Forces", "", *weight.phases_table(facts, ("Fy", "Fz"))]


def draw(result: Result, path: Path) -> None:
    """Figure 3, and the forces below it."""
    axes = ("Fx", "Fy", "Fz") if result.is_recorded else ("Fy", "Fz")
    below = traces.panels(result.trial, result.estimates, axes)
    traces.draw(result.trial, below, f"Shear trial (Lin 2013, figure 3): {result.source}", path, MARKED)
