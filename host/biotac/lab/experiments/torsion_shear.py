"""Torsion with shear: Lin, Fishel and Loeb 2013, figure 10.

Region II is the torsion trial of figure 9; in regions I and III the same torsions act while the weight is also pushed
towards E11 (+y) and E1 (-y). The paper gives no numbers and calls its estimates of the two "substantially convolved".
The figures here are whether the torsion's sign is right in each region, and how much of a pure torsion (region II)
shows up as lateral force.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from ...core.geometry import Floats
from ...markdown import table
from . import shear, torsion, traces, weight
from .estimates import PAPER, Estimate, rmse
from .outcome import Facts, Options, claim, number, text
from .torsion import TORSION_NMM
from .trial import Bools, Trial
from .weight import E17_MM, WEIGHT_N, Result

RECORDING = "E, F and M"
MAPS = True

SHEAR_N = 1.5  # the paper gives none; numerics.md 3.4 uses this for the figure
REGIONS = {"I": 1.0, "II": 0.0, "III": -1.0}  # push along +y
HOLD_S = 2.5
# clockwise is negative about the outward normal, see torsion.py
TURNS = (("rest", 0.0), ("clockwise", -1.0), ("between", 0.0), ("counter", 1.0), ("after", 0.0))


def replay(
    at_mm: tuple[float, float] = E17_MM,
    *,
    seed: int = 1,
    force_n: float = WEIGHT_N,
    shear_n: float = SHEAR_N,
    torsion_nmm: float = TORSION_NMM,
    **more: Any,
) -> Trial:
    """Figure 10 on an emulated finger: states, counts, the truth and the board's results.

    ``at_mm`` places the weight; ``force_n`` > 0 is its normal force, ``shear_n`` the push towards +y in region I and
    -y in III, ``torsion_nmm`` the torque's size. Phases are called "I clockwise", "II counter", ... after REGIONS and
    TURNS. ``more`` goes to weight.emulated.
    """
    turned = [
        (f"{region} {turn}", force_n, push * shear_n, sign * torsion_nmm)
        for region, push in REGIONS.items()
        for turn, sign in TURNS
    ]
    steps = [("B", force_n, 0.0, 0.0), *turned, ("G", 0.0, 0.0, 0.0)]
    return weight.emulated("figure 10", steps, HOLD_S, seed, at_mm=at_mm, **more)


def signs(trial: Trial, its: Estimate, at_mm: Floats) -> dict[str, bool]:
    """By region, whether the mean torsion at contacts (n, 3) has the true sign in both turns; {} without torque."""
    assert trial.torsion_nmm is not None
    turned = its.torsion_nmm(at_mm)
    if turned is None:
        return {}
    found = {}
    for region in REGIONS:
        rows = [_rows(trial, f"{region} {turn}") for turn in ("clockwise", "counter")]
        found[region] = all(np.sign(np.nanmean(turned[r])) == np.sign(trial.torsion_nmm[r].mean()) for r in rows)
    return found


def leakage(trial: Trial, its: Estimate) -> float:
    """Size of Fy in N per N mm of pure torsion, between the two turns of region II, where the true Fy is 0."""
    assert trial.torsion_nmm is not None
    one, other = (_rows(trial, f"II {turn}") for turn in ("clockwise", "counter"))
    lateral, torsion_nmm = its.force_n[:, 1], trial.torsion_nmm
    leaked = lateral[other].mean() - lateral[one].mean()
    return abs(float(leaked / (torsion_nmm[other].mean() - torsion_nmm[one].mean())))


def together(trial: Trial, its: Estimate) -> dict[str, float | None]:
    """RMSE of Fy and of the torsion at the true contact while both shear and torsion act, all ramps included."""
    assert trial.states is not None and trial.at_mm is not None
    pushed = np.linalg.norm(trial.states.shear_n, axis=1) > 0.0
    rows = np.asarray(pushed & (trial.states.torsion_nmm != 0.0))
    lateral = rmse(its.force_n, trial.force_n, rows)
    turned = rmse(its.torsion_nmm(trial.at_mm), trial.torsion_nmm, rows)
    return {"fy_rmse_n": number(float(lateral[1])), "torsion_rmse_nmm": number(float(turned[0]))}


def _rows(trial: Trial, name: str) -> Bools:
    return trial.during(next(phase for phase in trial.phases if phase.name == name))


def run(options: Options) -> Result:
    """Run on an emulated finger or a recording."""
    how = f"turned by {TORSION_NMM:g} N mm; pushed with {SHEAR_N:g} N to +y in region I, not in II, to -y in III"
    before = (partial(shear.emulated, take=1), partial(torsion.emulated, take=2))
    return weight.run(options, lambda seed: replay(seed=seed), how, torque=True, before=before)


def facts(result: Result) -> Facts:
    """Errors, phases, signs and leakage. Only maps are checked: the paper's model is known to fail."""
    its = weight.facts_of(result, "torsion-shear")
    if result.trial.is_recorded:
        return its
    for estimate in result.estimates:
        one = its["models"][estimate.name]
        assert result.trial.at_mm is not None
        one["sign_right"] = signs(result.trial, estimate, result.trial.at_mm)
        one["sign_right_at_poc"] = signs(result.trial, estimate, result.trial.frames["poc_mm"])
        one["together"] = together(result.trial, estimate)
        one["leak_n_per_nmm"] = number(leakage(result.trial, estimate))
    paper = its["models"][PAPER]
    for name in list(its["models"])[len(its["scales_nn_per_count"]) :]:
        one = its["models"][name]
        right = len(one["sign_right"]) == len(REGIONS) and all(one["sign_right"].values())
        its["checks"] += [
            claim(f"{name}: the torsion's sign is right in all three regions", right),
            claim(f"{name}: pure torsion leaks less into Fy than with the paper's model",
                  one["leak_n_per_nmm"] < paper["leak_n_per_nmm"]),
        ]  # fmt: skip
    return its


def page(facts: Facts) -> list[str]:
    """Signs and leakage, errors, then means by phase."""
    if not facts["phases"]:
        return weight.errors_table(facts)
    words = {True: "right", False: "WRONG", None: "-"}
    rows = []
    for name, one in facts["models"].items():
        marks = [words[one[key].get(region)] for key in ("sign_right", "sign_right_at_poc") for region in REGIONS]
        both = [text(value) for value in one["together"].values()]
        rows.append([name, *marks, text(one["leak_n_per_nmm"]), *both])
    head = ["model", *[f"sign in {region}" for region in REGIONS], *[f"{region}, board's point" for region in REGIONS]]
    return [
        "Sign of the torsion in both turns of each region, at the true contact and at the point of contact the board",
        "publishes; how much of region II's pure torsion appears as Fy; RMSE with both shear and torsion.",
        "",
        *table([*head, "leak [N per N mm]", "Fy with both [N]", "torsion with both [N mm]"], rows),
        *weight.errors_table(facts),
        *weight.phases_table(facts, ("Fy", "torsion")),
    ]


def draw(result: Result, figure: Any) -> None:
    """Figure 10, with the torsion about the contact's normal."""
    title = f"Torsion with shear (Lin 2013, figure 10): {result.source}"
    traces.draw(result.trial, result.estimates, ("Fy", "Fz", "torsion"), title, figure, torsion.MARKED)
