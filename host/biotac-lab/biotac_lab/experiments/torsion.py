"""The torsion trial: Lin, Fishel and Loeb 2013, figure 9, phases A to G.

A 500 g weight with a flat surface lies on the pad and is turned clockwise, then counter-clockwise, for five seconds
each. The paper plots Fz and the torque about z against the force plate without numbers. It claims to extract pure
torques, so the checks are the torques' signs.
"""

from __future__ import annotations

from functools import partial

from ..report import Options, Report, claim
from . import weight
from .weight import WEIGHT_N

RECORDING = "E, F and M"
ACCEPTS = ("maps",)

TORSION_NMM = 6.0  # the paper gives none: such a flat holds this under 5 N at moderate friction
HOLD_S = 4.5
MARKED = ("E2", "E3", "E12", "E13", "E17")
# The finger lies pad up. The turn is named as seen from above, along the inward normal, so clockwise is negative about
# the outward normal.
TURNS_NMM = {"B": 0.0, "C": -TORSION_NMM, "D": 0.0, "E": TORSION_NMM, "F": 0.0}
STEPS = (*[(name, WEIGHT_N, 0.0, turn_nmm) for name, turn_nmm in TURNS_NMM.items()], ("G", 0.0, 0.0, 0.0))

#: Figure 9 on an emulated finger.
emulated = partial(weight.emulated, "figure 9", STEPS, HOLD_S)


def run(options: Options) -> Report:
    """Errors, figure 9's curves by phase and the torsion's signs; on an emulated finger or a recording."""
    how = (
        f"turned by {TORSION_NMM:g} N mm clockwise in C and counter-clockwise in E; the normal there is -z, so Mz is "
        "minus the torsion"
    )
    result = weight.run(options, emulated, how, torque=True)
    trial, checks = result.trial, []
    if not trial.is_recorded:
        held = {phase.name: trial.during(phase) for phase in trial.phases}
        for model in (result.estimates[0], *result.maps):
            turned = model.torsion_nmm(trial.at_mm)
            if turned is not None:
                right = turned[held["C"]].mean() < 0.0 < turned[held["E"]].mean()
                checks.append(claim(f"the torsion's sign is right in C and E: {model.name}", bool(right)))
    axes = ("Fz", "Mz", "torsion")
    return result.report(weight.means(result, axes), checks, axes, "Torsion trial (Lin 2013, figure 9)", MARKED)
