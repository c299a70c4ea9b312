"""Tasks that Wettels and Loeb 2011 leave to others: two contacts at once, and the direction of an edge."""

from __future__ import annotations

import numpy as np

from biotac.core import geometry as surface
from biotac.sim import SimFinger, States
from biotac_lab.features import several
from biotac_lab.features.signals import skin

from ...learn import edge
from ...learn.probes import PROBES, counts_of, footprints
from ...learn.stimulations import press_bars
from ...report import Facts, plain
from ..trial import Floats

APART_MM = (6.0, 8.0, 10.0, 12.0, 14.0)
PAD_D_MM, PAD_R_MM = (3.0, 15.0), 5.0
FORCE_N = (3.0, 8.0)
TEST_SHARE = 0.15


def bars(finger: SimFinger, presses: int, seed: int, steps: int) -> Facts:
    """Error in degrees of an edge's direction, for presses that were not in training."""
    counts, tare, angle = press_bars(finger, presses, seed=seed)
    seen = edge.columns(counts - tare, tare)
    known = round((1.0 - TEST_SHARE) * presses)
    net = edge.train(seen[:known], angle[:known], seed=seed, steps=steps)
    off = np.degrees(edge.turn(edge.direction(net, seen[known:]), angle[known:]))
    rmse, median = float(np.sqrt((off**2).mean())), float(np.median(np.abs(off)))
    return {"presses": presses, "test": len(off), "rmse_deg": plain(rmse), "median_deg": plain(median)}


def pairs(finger: SimFinger, each: int, seed: int) -> list[Facts]:
    """One row per distance, 0 for one contact: how often the number was right, and then errors of place and share."""
    rng = np.random.default_rng([seed, 36])
    tare = finger.rest_counts(np.zeros(1))[0]
    rows = []
    for apart in (0.0, *APART_MM):
        right, off, share_off = 0, [], []
        places = np.array([_pair(apart, rng) for _ in range(each)])[:, : 1 if apart == 0.0 else 2]
        force = rng.uniform(*FORCE_N, places.shape[:2])
        estimates = _read(finger, places, force, rng) - tare
        for row, true_mm, true_n in zip(estimates, places, force, strict=True):
            found = several.contacts(row)
            if len(found) != len(true_mm):
                continue
            right += 1
            at = np.array([contact.poc_mm for contact in found])
            far = np.linalg.norm(at[:, None] - true_mm[None], axis=2)
            swapped = len(found) == 2 and far[0, 1] + far[1, 0] < far[0, 0] + far[1, 1]
            order = [1, 0] if swapped else list(range(len(found)))
            off += [far[k, order[k]] for k in range(len(found))]
            share_off.append(found[0].share - true_n[order[0]] / true_n.sum())
        rows.append({
            "apart_mm": apart, "tried": each, "right": plain(right / each),
            "poc_rmse_mm": plain(_rms(off)), "share_rmse": plain(_rms(share_off)),
        })  # fmt: skip
    return rows


def _pair(apart: float, rng: np.random.Generator) -> Floats:
    """Two places (2, 3) on the pad, ``apart`` mm from each other along the unrolled skin."""
    while True:
        first = np.array([rng.uniform(*PAD_D_MM), rng.uniform(-PAD_R_MM, PAD_R_MM)])
        way = rng.uniform(0.0, 2.0 * np.pi)
        dr = np.array([first, first + apart * np.array([np.cos(way), np.sin(way)])])
        if PAD_D_MM[0] <= dr[1, 0] <= PAD_D_MM[1] and abs(dr[1, 1]) <= PAD_R_MM:
            roll = dr[:, 1] / surface.RADIUS_MM
            x = dr[:, 0] + surface.PROXIMAL_END_MM
            places = np.column_stack([x, surface.RADIUS_MM * np.sin(roll), -surface.RADIUS_MM * np.cos(roll)])
            assert np.allclose(skin(places), dr)
            return places


def _read(finger: SimFinger, places: Floats, force: Floats, rng: np.random.Generator) -> Floats:
    n, none = len(places), np.zeros(len(places))
    touching = []
    for k in range(places.shape[1]):
        states = States(places[:, k], force[:, k], np.zeros((n, 3)), none, none, none)
        touching.append((states, footprints(PROBES[1], places[:, k], force[:, k])))
    exact = counts_of(finger, touching)
    result: Floats = np.clip(np.rint(exact + rng.normal(0.0, finger.noise_counts, exact.shape)), 0.0, 4095.0)
    return result


def _rms(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values else np.nan
