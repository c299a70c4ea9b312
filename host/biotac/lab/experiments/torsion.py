"""The torsion trial: Lin, Fishel and Loeb 2013, figure 9, phases A to G.

A 500 g weight with a flat surface lies on the pad and is turned clockwise, then counter-clockwise, for five seconds
each. The paper plots Fz and the torque about z against the force plate without numbers. It claims to extract pure
torques, so the checks are the torques' signs.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from . import traces, weight
from .estimates import PAPER
from .outcome import Facts, Options, claim
from .weight import WEIGHT_N, Result

RECORDING = "E, F and M"
MAPS = True

TORSION_NMM = 6.0  # the paper gives none: this is what such a flat holds under 5 N at moderate friction
HOLD_S = 4.5
MARKED = ("E2", "E3", "E12", "E13", "E17")
# The finger lies pad up. The turn is named as seen from above, along the inward normal, so clockwise is negative about
# the outward normal.
TURNS_NMM = {"B": 0.0, "C": -TORSION_NMM, "D": 0.0, "E": TORSION_NMM, "F": 0.0}
STEPS = (*[(name, WEIGHT_N, 0.0, turn_nmm) for name, turn_nmm in TURNS_NMM.items()], ("G", 0.0, 0.0, 0.0))

#: Figure 9 on an emulated finger.
emulated = partial(weight.emulated, "figure 9", STEPS, HOLD_S)


def run(options: Options) -> Result:
    """Run on an emulated finger or a recording."""
    how = (
        f"turned by {TORSION_NMM:g} N mm clockwise in C and counter-clockwise in E; the normal there is -z, so Mz is "
        "minus the torsion"
    )
    return weight.run(options, emulated, how, torque=True)


def facts(result: Result) -> Facts:
    """Errors, phases, and the signs."""
    its = weight.facts_of(result, "torsion")
    if not result.trial.is_recorded:
        means = {phase["name"]: phase for phase in its["phases"]}
        its["checks"] = [
            claim(f"the torsion's sign is right in C and E: {name}",
                  means["C"]["models"][name]["torsion"] < 0.0 < means["E"]["models"][name]["torsion"])
            for name in its["models"] if name == PAPER or "torsion_rmse_nmm" in its["models"][name]
        ]  # fmt: skip
    return its


def page(facts: Facts) -> list[str]:
    """Errors, then figure 9's two curves by phase."""
    return [*weight.errors_table(facts), *weight.phases_table(facts, ("Fz", "Mz", "torsion"))]


def draw(result: Result, figure: Any) -> None:
    """Figure 9: electrodes, Fz, Mz; and the torsion about the contact's normal."""
    title = f"Torsion trial (Lin 2013, figure 9): {result.source}"
    traces.draw(result.trial, result.estimates, ("Fz", "Mz", "torsion"), title, figure, MARKED)
