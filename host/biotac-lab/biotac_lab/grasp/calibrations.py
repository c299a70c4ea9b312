"""Two minutes of presses by hand on a force plate, by the board, and `biotac calibrate wrench` on them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from biotac.calibrate.population import load as load_population
from biotac.calibrate.wrench import run_of, validate
from biotac.core import geometry as surface
from biotac.sim import SimFinger, SimTouch, world

from ..gains import fit_gains

REST_S, PRESSES_S, PRESS_S, PAUSE_S, RAMP_S = 8.0, 120.0, 0.9, 0.3, 0.3
PAD_MM, ROLL_MM = ((-12.0, -3.0), (2.5, 3.0)), 3.0  # where a hand meets things, and how far a press rolls
FORCE_N, PULL, MOST_PULL_N = (0.5, 10.0), (0.2, 0.9), 2.5
PLATE_N = 1 / 320  # the plate's resolution; noise is 0.7 of that


def hand_presses(seed: int) -> tuple[list[SimTouch], np.ndarray]:
    """The touches of each round in two minutes, and the force (n, 3) on the finger in N that the plate measures.

    They lie all over the pad: a map is blind where it was not taught. Each press, of 0.5 to 10 N, rolls by some mm and
    is drawn once around by 0.2 to 0.9 of its force, 2.5 N at most. If it is drawn by less, or to one side alone, shear
    stays unlearnt, and reads half to two thirds of the true one. If it is drawn by more, the shear felt in a firm grip
    doubles, as skin yields less to a strong pull.
    """
    rng, touches, forces = np.random.default_rng([seed, 45]), list[SimTouch](), []
    while len(touches) < PRESSES_S * 100:
        begin_mm = rng.uniform(*PAD_MM)
        end_mm = np.clip(begin_mm + rng.uniform(-ROLL_MM, ROLL_MM, 2), *PAD_MM)
        peak_n, pull = FORCE_N[0] * (FORCE_N[1] / FORCE_N[0]) ** rng.random(), rng.uniform(*PULL)
        turn_rad, sense = rng.uniform(0, 2 * np.pi), rng.choice([-1, 1])
        for t_s in np.arange(0, PRESS_S + PAUSE_S, 0.01):
            share = min(t_s / PRESS_S, 1)
            x_mm, y_mm = (float(part) for part in begin_mm + share * (end_mm - begin_mm))
            normal = surface.normals_at(surface.on_surface(np.array([[x_mm, y_mm]])))
            normal_n = float(peak_n * np.clip(min(t_s, PRESS_S - t_s) / RAMP_S, 0, 1))
            angle = turn_rad + sense * 2 * np.pi * share
            pulled_n = min(normal_n * pull, MOST_PULL_N) * min(1, 6 * share, 6 * (1 - share))
            to_tip, to_side = float(pulled_n * np.cos(angle)), float(pulled_n * np.sin(angle))
            touches.append(SimTouch(normal_n, (to_tip, to_side), (x_mm, y_mm)))
            tangents = np.concatenate(surface.tangents_at(normal))
            forces.append(np.array([to_tip, to_side]) @ tangents - normal_n * normal[0])
    measured = np.array(forces) + rng.normal(0, 0.7 * PLATE_N, (len(forces), 3))
    return touches, np.rint(measured / PLATE_N) * PLATE_N


def calibrate(seeds: dict[str, int], profile: Any) -> dict[str, Any]:
    """By finger ``maps`` as boards store them, in hex, and ``gains`` for x, y, z in nN a count."""
    plays = {name: hand_presses(seed) for name, seed in seeds.items()}
    rest, counts, found = round(REST_S * 100), dict[str, Any](), {"maps": dict[str, Any](), "gains": dict[str, Any]()}
    with world({name: SimFinger(seed, profile) for name, seed in seeds.items()}) as hand:
        loads: list[dict[str, SimTouch]] = [{}] * rest + [
            dict(zip(plays, each, strict=True)) for each in zip(*(play[0] for play in plays.values()), strict=True)
        ]
        rounds = [hand.step(**load) for load in loads]
    for name in plays:
        counts[name] = np.array([now[name].frame.counts for now in rounds])  # type: ignore[union-attr]
    others, _ = load_population(None).others_than([])
    for name, (_, force_n) in plays.items():
        idle, pressed = counts[name][rest - 500 : rest], counts[name][rest:]
        plate = np.column_stack([force_n[:, 1], force_n[:, 0], -force_n[:, 2]])  # a recording's axes: wrench.md
        run = run_of(Path(name), {"E": pressed, "F": plate, "E_base": idle})
        found["maps"][name] = validate(run, others=others).wrench_map.on_board().blob.hex()
        gains = fit_gains(pressed - idle.mean(axis=0), force_n, np.zeros_like(force_n))
        found["gains"][name] = [gains[f"force_gain_{axis}_nn"] for axis in "xyz"]
    return found
