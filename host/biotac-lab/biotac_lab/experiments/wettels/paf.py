"""Wettels and Loeb 2011, table 3 and figures 4, 6, 8 and 9, emulated: PAF by each technique, and correlations."""

from __future__ import annotations

from typing import Any

import numpy as np

from biotac.core import geometry as surface
from biotac.sim import SimFinger, States
from biotac_lab.features.paf import THRESHOLD_N, paf
from biotac_lab.features.signals import skin

from ...learn import inputs
from ...learn.smooth import causal, lowess
from ...learn.stimulations import Stimulations, stimulate
from ...report import Facts, plain
from ..scores import score
from ..trial import Floats
from .roc import filtered

LOADS_N = {"30 to 40 N, as the paper": (30.0, 40.0), "6 to 12 N": (6.0, 12.0)}
EQUATIONS = {"as printed": True, "rest offset removed": False}
TECHNIQUES = ("none", "11-point LOWESS", "force threshold", "both", "causal 11 taps and threshold")
FRAMES, FILTERED_FRAMES = 20, 60  # of a press


def run(finger: SimFinger, places: tuple[int, ...], seed: int, low: bool = False) -> tuple[list[Facts], Any]:
    """A row per load, equation and technique; and for the drawing, true and estimated places of the first load.

    ``low``: through the paper's low-pass, which needs more rows of a press.
    """
    frames = FILTERED_FRAMES if low else FRAMES
    rows: list[Facts] = []
    drawn: Any = None
    for load, peak_n in LOADS_N.items():
        pressed = stimulate(finger, places, seed=seed, frames=frames, peak_n=peak_n)
        pressed = filtered(pressed, frames) if low else pressed
        truth = skin(pressed.contact_mm)
        firm = np.linalg.norm(pressed.force_n, axis=1) > THRESHOLD_N
        for equation, as_printed in EQUATIONS.items():
            estimates = paf(pressed.counts - pressed.tare, as_printed=as_printed, threshold_n=0.0)["dr_mm"]
            for technique in TECHNIQUES:
                found = _by(technique, estimates, firm, pressed)
                row: Facts = {"load": load, "equation": equation, "technique": technique}
                row["share"] = plain(np.isfinite(found).all(axis=1).mean())
                for k, name in enumerate("dr"):
                    row[name] = score(found[:, k], truth[:, k])
                rows.append(row)
                if drawn is None and technique == "both" and not as_printed:
                    drawn = truth, estimates, found
    return rows, drawn


def _by(technique: str, estimates: Floats, firm: Any, pressed: Stimulations) -> Floats:
    """The ``estimates`` by one technique; each contact is smoothed alone, as nothing lies between two of them."""
    found = estimates if technique in TECHNIQUES[:2] else np.where(firm[:, None], estimates, np.nan)
    if technique in ("none", "force threshold"):
        return found
    smooth = np.full_like(found, np.nan)
    for contact in np.unique(pressed.contact):
        rows = np.flatnonzero((pressed.contact == contact) & np.isfinite(found).all(axis=1))
        if len(rows) >= 11:
            smooth[rows] = causal(found[rows]) if technique.startswith("causal") else lowess(found[rows])
    return smooth


def correlations(finger: SimFinger, places: tuple[int, ...], seed: int) -> list[list[float | None]]:
    """Figure 6: absolute Spearman coefficients (19, 3) of the electrodes with Fx, Fy and Fz."""
    pressed = stimulate(finger, places, seed=seed, frames=5)
    found = inputs.correlations(pressed.counts - pressed.tare, pressed.force_n)
    return [[plain(value) for value in row] for row in found.tolist()]


def impedance(finger: SimFinger) -> list[Facts]:
    """Figure 4: resistance of E18 over that at rest when a 2 mm probe presses with 10 N on a grid of 4 by 5 about it.

    By the distance from the electrode along the unrolled skin, nearest first.
    """
    d, r = (grid.ravel() for grid in np.meshgrid([-4.0, -1.5, 1.5, 4.0], [-4.0, -2.0, 0.0, 2.0, 4.0]))
    over, n = surface.ELECTRODE_MM[17], len(d)
    roll = np.arctan2(over[1], -over[2]) + r / surface.RADIUS_MM
    round_mm = surface.RADIUS_MM * np.column_stack([np.sin(roll), -np.cos(roll)])
    states = States(
        surface.project(np.column_stack([over[0] + d, round_mm])), np.full(n, 10.0), np.zeros((n, 3)), np.zeros(n),
        np.full(n, 1.0), np.zeros(n),
    )  # fmt: skip
    counts = finger.counts(states)[:, 17]
    rest = finger.rest_counts(np.zeros(1))[0, 17]
    ratio = (4095.0 / counts - 1.0) / (4095.0 / rest - 1.0)
    found = sorted(zip(np.hypot(d, r).tolist(), ratio.tolist(), strict=True))
    return [{"mm": plain(mm), "ratio": plain(value)} for mm, value in found]
