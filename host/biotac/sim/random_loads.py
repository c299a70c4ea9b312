"""Random loads on an emulated finger, and the calibration recording that a force plate would make of them.

One frame per load: the contact's place, normal force, shear, torsion and footprint are all drawn anew, so that a model
can learn nothing from how a load moves. The parts to hold out together are cells of the pad.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ..core import geometry as surface
from ..kernels.geometry import Floats
from ..recording.npz_file import to_lin_frame
from ..wire import sensor_gen as _sensor
from . import sampling
from .physics import SimFinger, States

CELL_MM, CELL_DEG = 1.5, 15.0  # the size of one contact location
X_MM = (-13.0, 3.5)  # the pad, including the tip's electrodes but not the seal
ROLL_DEG = 55.0
FORCE_N = (1.0, 12.0)  # log-uniform: the paper's point of contact is good from 1 N
FRICTION = 0.6
TORSION_PER_N, TORSION_MAX_NMM = 2.0, 12.0  # N mm per newton: over friction times two thirds of a flat's radius
FOOTPRINTS_MM = (0.6, 1.0, 1.8, 3.5)
SHARES = {"both": 0.6, "torsion": 0.2, "shear": 0.1, "press": 0.1}  # of the frames
REST_FRAMES, IDLE_FRAMES, IDLE_DRIFT_COUNTS = 500, 1000, 200.0


def random_loads(frames: int, seed: int) -> tuple[States, npt.NDArray[np.int64]]:
    """Random loads (frames,) of one contact each, and the number of the cell that holds each contact."""
    rng = np.random.default_rng([seed, 31])
    x = rng.uniform(*X_MM, frames)
    roll = rng.uniform(-ROLL_DEG, ROLL_DEG, frames)
    ring = np.sqrt(surface.RADIUS_MM**2 - np.maximum(x, 0.0) ** 2)
    contact = np.column_stack([x, ring * np.sin(np.radians(roll)), -ring * np.cos(np.radians(roll))])
    force = FORCE_N[0] * (FORCE_N[1] / FORCE_N[0]) ** rng.random(frames)
    kind = rng.choice(list(SHARES), frames, p=list(SHARES.values()))
    size = FRICTION * force * np.sqrt(rng.random(frames)) * np.isin(kind, ("both", "shear"))
    turn = rng.uniform(0.0, 2.0 * np.pi, frames)
    to_tip, to_side = surface.tangents_at(surface.normals_at(contact))
    shear = to_tip * (size * np.cos(turn))[:, None] + to_side * (size * np.sin(turn))[:, None]
    torsion = rng.uniform(-1.0, 1.0, frames) * np.minimum(TORSION_PER_N * force, TORSION_MAX_NMM)
    torsion *= np.isin(kind, ("both", "torsion"))
    cell = np.floor(x / CELL_MM).astype(np.int64) * 100 + np.floor(roll / CELL_DEG).astype(np.int64)
    footprint = rng.choice(FOOTPRINTS_MM, frames)
    return States(contact, force, shear, torsion, footprint, np.zeros(frames)), cell


def plate_recording(finger: SimFinger, loads: States, cell: npt.NDArray[np.int64], seed: int) -> dict[str, Any]:
    """The arrays of a calibration's .npz: the noisy counts of ``finger`` under ``loads``, and the plate's truth."""
    rng = np.random.default_rng([seed, 32])

    def read(counts: Floats, sigma: float) -> npt.NDArray[np.uint16]:
        noisy = np.rint(counts + rng.normal(0.0, sigma, counts.shape))
        return np.clip(noisy, 0, _sensor.FULL_SCALE_COUNT).astype(np.uint16)

    force, torque = loads.wrench()
    at_rest, pressed = finger.rest_counts(np.zeros(1)), sampling.effects_of(finger, loads)
    warming = np.linspace(0.0, IDLE_DRIFT_COUNTS, IDLE_FRAMES)[:, None]
    loading = finger.drift_per_min / finger.drift_per_min.mean()
    return {
        "E": read(pressed["exact"], finger.noise_counts),
        "F": to_lin_frame(force),  # the same turn leads back to a recording's axes
        "M": to_lin_frame(torque),
        "torsion": loads.torsion_nmm,
        "PDC": read(finger.pdc_rest + pressed["pressure"], sampling.PDC_NOISE),
        "E_base": read(np.repeat(at_rest, REST_FRAMES, axis=0), finger.noise_counts),
        "E_idle": read(at_rest + warming * loading, finger.noise_counts),
        "contact": cell,
    }
