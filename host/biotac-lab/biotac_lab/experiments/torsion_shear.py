"""Torsion with shear: Lin, Fishel and Loeb 2013, figure 10.

Region II is the torsion trial of figure 9; in regions I and III the same torsions act while the weight is also pushed
towards E11 (+y) and E1 (-y). The paper gives no numbers and calls the estimates of the two "substantially convolved".
The figures here are whether the torsion's sign is right in each region, and how much of a pure torsion (region II)
shows up as lateral force.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from biotac.core import geometry as surface

from ..report import Facts, Options, Report, Table, claim
from . import poke, shear, torsion, weight
from .estimates import Estimate, by_paper, paper_scales, rmse
from .torsion import TORSION_NMM
from .trial import Bools, Floats, Trial
from .weight import E17_MM, WEIGHT_N, Result

RECORDING = "E, F and M"
ACCEPTS = ("maps",)

SHEAR_N = 1.5  # the paper gives none
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

    ``at_mm`` places the weight; ``force_n`` > 0 is the normal force, ``shear_n`` the push towards +y in region I and
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


def signs(trial: Trial, model: Estimate, at_mm: Floats) -> dict[str, bool]:
    """By region, whether the mean torsion at contacts (n, 3) has the true sign in both turns; {} without torque."""
    turned = model.torsion_nmm(at_mm)
    if turned is None:
        return {}
    found = {}
    for region in REGIONS:
        rows = [_rows(trial, f"{region} {turn}") for turn in ("clockwise", "counter")]
        found[region] = all(np.sign(np.nanmean(turned[r])) == np.sign(trial.torsion_nmm[r].mean()) for r in rows)
    return found


def leakage(trial: Trial, model: Estimate) -> float:
    """Size of Fy in N per N mm of pure torsion, between the two turns of region II, where the true Fy is 0."""
    clockwise, counter = (_rows(trial, f"II {turn}") for turn in ("clockwise", "counter"))
    lateral, torsion_nmm = model.force_n[:, 1], trial.torsion_nmm
    leaked = lateral[counter].mean() - lateral[clockwise].mean()
    return abs(float(leaked / (torsion_nmm[counter].mean() - torsion_nmm[clockwise].mean())))


def together(trial: Trial, model: Estimate) -> tuple[float, float]:
    """RMSE of Fy, N, and of the torsion at the true contact, N mm, while both act, all ramps included."""
    assert trial.states is not None
    pushed = np.linalg.norm(trial.states.shear_n, axis=1) > 0.0
    rows = np.asarray(pushed & (trial.states.torsion_nmm != 0.0))
    lateral = rmse(model.force_n, trial.force_n, rows)
    turned = rmse(model.torsion_nmm(trial.at_mm), trial.torsion_nmm, rows)
    return float(lateral[1]), float(turned[0])


def _rows(trial: Trial, name: str) -> Bools:
    return trial.during(next(phase for phase in trial.phases if phase.name == name))


def measure(options: Options) -> Result:
    """The trial and the estimates, on an emulated finger or a recording."""
    how = f"turned by {TORSION_NMM:g} N mm; pushed with {SHEAR_N:g} N to +y in region I, not in II, to -y in III"
    before = (partial(shear.emulated, repeat=1), partial(torsion.emulated, repeat=2))
    return weight.run(options, lambda seed: replay(seed=seed), how, torque=True, before=before)


def convolved(result: Result) -> Table:
    """Signs and leakage of each model."""
    trial, verdict = result.trial, {True: "right", False: "WRONG", None: "-"}
    rows: list[list[Any]] = []
    for model in result.estimates:
        found = [signs(trial, model, at_mm) for at_mm in (trial.at_mm, trial.frames["poc_mm"])]
        marks = [verdict[right.get(region)] for right in found for region in REGIONS]
        rows.append([model.name, *marks, leakage(trial, model), *together(trial, model)])
    head = ["model", *[f"sign in {region}" for region in REGIONS], *[f"{region}, board's point" for region in REGIONS]]
    text = (
        "Sign of the torsion in both turns of each region, at the true contact and at the point of contact the board "
        "publishes; how much of region II's pure torsion appears as Fy; RMSE with both shear and torsion."
    )
    head += ["leak [N per N mm]", "Fy with both [N]", "torsion with both [N mm]"]
    return Table("Torsion against shear", head, rows, text)


def torque_x(trial: Trial, seed: int) -> Table:
    """Eq 4's x: the sum as printed, scaled by figure 3's trial, and the lever of the paper's force."""
    arms = np.cross(surface.ELECTRODE_MM, surface.ELECTRODE_NORMAL)[:, 0]
    before, pokes = shear.emulated(seed, repeat=1), poke.emulated(seed, "new")
    learnt = np.nan_to_num(before.signal) @ arms
    scale = float(learnt @ before.torque_nmm[:, 0] / (learnt @ learnt))
    rows: list[list[Any]] = [["as printed"], ["lever"], ["truth"]]
    for each in (trial, pokes):
        by = by_paper(each, paper_scales([each])).torque_nmm
        assert by is not None
        pressed = np.isfinite(by[:, 0]) & (np.linalg.norm(each.force_n, axis=1) > 0.0)
        truth = each.torque_nmm[pressed, 0]
        found = np.nan_to_num(each.signal[pressed]) @ arms * scale - truth, by[pressed, 0] - truth, truth
        for row, off in zip(rows, found, strict=True):
            row.append(float(np.sqrt((off**2).mean())))
    text = "RMSE, and the truth's RMS: figure 10's trial, and a poke of each electrode, whose force meets the axis."
    return Table("Torque x", ["", "figure 10 [N mm]", "pokes [N mm]"], rows, text)


def checks(result: Result) -> list[Facts]:
    """Of maps only: the paper's model is known to fail."""
    trial, found = result.trial, []
    for model in result.maps:
        right = signs(trial, model, trial.at_mm)
        found += [
            claim(f"{model.name}: the torsion's sign is right in all three regions",
                  bool(right) and all(right.values())),
            claim(f"{model.name}: pure torsion leaks less into Fy than with the paper's model",
                  leakage(trial, model) < leakage(trial, result.estimates[0])),
        ]  # fmt: skip
    return found


def run(options: Options) -> Report:
    """Signs, leakage, errors and means by phase; on an emulated finger or a recording."""
    result = measure(options)
    axes, title = ("Fy", "Fz", "torsion"), "Torsion with shear (Lin 2013, figure 10)"
    if result.trial.is_recorded:
        return result.report([], [], axes, title, torsion.MARKED)
    tables = [convolved(result), torque_x(result.trial, options.seed), *weight.means(result, ("Fy", "torsion"))]
    return result.report(tables, checks(result), axes, title, torsion.MARKED)
