"""Force-plate recordings of synthetic fingers: the sensor model under a random, smooth load."""

from pathlib import Path
from typing import Any

import numpy as np

from biotac.core import geometry as surface
from biotac.sim.physics import SimFinger, States

KEYFRAME_ROWS = 40
NOISE_COUNTS = 4.0
DRIFT = np.linspace(0.8, 1.2, 19)  # mean 1


def states(rows: int, seed: int, *, rests: bool) -> States:
    """A pad pressed here and there, sheared and twisted; with ``rests``, let go about every second."""
    rng = np.random.default_rng([seed, 7])
    keys = rows // KEYFRAME_ROWS + 2
    at = np.arange(rows) / KEYFRAME_ROWS

    def smooth(low: float, high: float) -> np.ndarray:
        return np.interp(at, np.arange(keys), rng.uniform(low, high, keys))

    force = np.interp(at, np.arange(keys), rng.uniform(1.5, 8.0, keys))
    if rests:
        force = np.where((at % 4.0) < 0.4, 0.0, force)
    contact = surface.on_surface(np.column_stack([smooth(-12.0, 2.0), smooth(-2.5, 2.5)]))
    to_tip, to_side = surface.tangents_at(surface.normals_at(contact))
    shear = to_tip * smooth(-2.0, 2.0)[:, None] + to_side * smooth(-2.0, 2.0)[:, None]
    touched = force > 0.0
    return States(
        contact, force, shear * touched[:, None], smooth(-5.0, 5.0) * touched, np.full(rows, 3.0), np.zeros(rows)
    )


def recorded(lin: np.ndarray) -> np.ndarray:
    """Lin's frame to the recorded axes, by hand: X = y, Y = x, Z = -z."""
    return np.column_stack([lin[:, 1], lin[:, 0], -lin[:, 2]])


def fields(
    rows: int = 5000, seed: int = 1, *, rests: bool = True, late_rows: int = 0, moment: bool = False, pdc: bool = False
) -> dict[str, Any]:
    """The arrays of one recording; counts come ``late_rows`` after the force."""
    rng = np.random.default_rng([seed, 8])
    finger = SimFinger(seed)
    moved = states(rows, seed, rests=rests)
    force, torque = moved.wrench()
    clean = finger.counts(moved)
    clean = np.concatenate([np.repeat(clean[:1], late_rows, axis=0), clean[: rows - late_rows]])
    at_rest = finger.rest_counts(np.zeros(1))

    def read(counts: np.ndarray) -> np.ndarray:
        return np.clip(np.rint(counts + rng.normal(0.0, NOISE_COUNTS, counts.shape)), 0, 4095).astype(np.uint16)

    result = {
        "E": read(clean),
        "F": recorded(force + rng.normal(0.0, 0.01, force.shape)).astype(np.float32),
        "E_base": read(np.repeat(at_rest, 500, axis=0)),
        "E_idle": read(at_rest + np.linspace(0.0, 200.0, 1000)[:, None] * DRIFT),
    }
    if moment:
        result["M"] = recorded(torque)
    if pdc:
        result["PDC"] = np.rint(1326.0 + 100.0 * moved.force_n).astype(np.uint16)
    return result


def save(path: Path, arrays: dict[str, Any]) -> Path:
    """As .npz."""
    np.savez(path, **arrays)
    return path
