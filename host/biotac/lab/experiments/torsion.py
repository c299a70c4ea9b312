"""The torsion trial: Lin, Fishel and Loeb 2013, figure 9, phases A to G.

A 500 g weight with a flat surface lies on the pad and is turned clockwise, then counter-clockwise, five
seconds each. The paper draws Fz and the torque about z against the force plate and gives no numbers; it
claims that pure torques are extracted, so the checks are the torques' signs.
"""

from __future__ import annotations

from pathlib import Path

from ...sim.physics import Profile
from . import traces, weight
from .estimates import PAPER
from .outcome import Facts, Options, claim
from .trial import Trial, play
from .weight import Result

RECORDING = "E, F and M"
MAPS = True

TORSION_NMM = 6.0  # the paper gives none: as much as such a flat under 5 N holds at moderate friction
HOLD_S = 4.5
MARKED = ("E2", "E3", "E12", "E13", "E17")
# phase, weight, turn. The finger lies pad up and is turned as seen from above, looking along the inward normal,
# so clockwise is negative about the outward one.
PHASES = (("B", 1.0, 0.0), ("C", 1.0, -1.0), ("D", 1.0, 0.0), ("E", 1.0, 1.0), ("F", 1.0, 0.0), ("G", 0.0, 0.0))


def emulated(
    seed: int, profile: Profile = "new", *, take: int = 0, noiseless: bool = False, mirrored: bool = False
) -> Trial:
    """Figure 9 on an emulated finger; ``mirrored`` is the same trial as its mirror image sees it."""
    side = -1.0 if mirrored else 1.0
    steps = [
        (name, weight.pose(force_n=load * weight.WEIGHT_N, torsion_nmm=side * turn * TORSION_NMM))
        for name, load, turn in PHASES
    ]
    script = weight.script(weight.pose(), steps, HOLD_S)
    return play("figure 9", script, seed=seed, profile=profile, take=take, noiseless=noiseless, mirrored=mirrored)


def run(options: Options) -> Result:
    """On an emulated finger or a recording."""
    if options.recording is not None:
        return weight.of_recording(options, torque=True)
    notes = [
        f"emulated sensor, new, seed {options.seed}: {weight.WEIGHT_N:.1f} N over E17, turned by {TORSION_NMM:g} N mm "
        "clockwise in C and counter-clockwise in E; the normal there is -z, so Mz is minus the torsion"
    ]
    source = f"emulated finger, seed {options.seed}"
    return weight.estimated(source, emulated(options.seed), options, notes, is_recorded=False)


def facts(result: Result) -> Facts:
    """Errors, phases, and the signs."""
    its = weight.facts_of(result, "torsion")
    if not result.is_recorded:
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


def draw(result: Result, path: Path) -> None:
    """Figure 9: electrodes, Fz, Mz; and the torsion about the contact's normal."""
    below = traces.panels(result.trial, result.estimates, ("Fz", "Mz", "torsion"))
    traces.draw(result.trial, below, f"Torsion trial (Lin 2013, figure 9): {result.source}", path, MARKED)
