"""How well a wrench says where a finger is touched: closed form against the paper's mesh, on random contacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...core import geometry as surface
from ...core.geometry import Floats
from . import contact

# Noise added to the wrench, in N and N mm: none, a Nano17's resolution, and that of a worse plate.
NOISES = (("exact wrench", 0.0, 0.0), ("Nano17's resolution", 1 / 320, 1 / 64), ("20 mN, 0.2 N mm", 0.02, 0.2))


@dataclass(frozen=True)
class ContactError:
    """Distances in mm between the contact found and the true one, over ``found`` contacts.

    A contact that noise puts beside the finger has no point and is not counted in ``found``.
    """

    noise: str
    method: str
    found: int
    rms_mm: float
    p95_mm: float
    max_mm: float


def compare(contacts: int, *, seed: int = 0) -> list[ContactError]:
    """Errors of both methods with every noise of NOISES, on ``contacts`` random contacts with shear and torsion."""
    rng = np.random.default_rng(seed)
    point, force, torsion = random_contacts(contacts, rng)
    torque = contact.moment(point, force, torsion)
    result = []
    for name, force_n, torque_nmm in NOISES:
        read_f = force + rng.normal(0.0, 1.0, force.shape) * force_n
        read_m = torque + rng.normal(0.0, 1.0, torque.shape) * torque_nmm
        closed = contact.locate(read_f, read_m)
        result.append(_error(name, "closed form", np.where(closed.missed[:, None], np.nan, closed.point_mm) - point))
        on_mesh = contact.locate_on_mesh(read_f, read_m)
        result.append(_error(name, f"mesh of {contact.MESH_STEP_MM:g} mm", on_mesh - point))
    return result


def random_contacts(count: int, rng: np.random.Generator) -> tuple[Floats, Floats, Floats]:
    """Points (n, 3) all over the ventral surface, forces (n, 3) of 0.5 to 20 N into it plus shear, torsions (n,)."""
    x, angle = rng.uniform(surface.PROXIMAL_END_MM, 0.95 * surface.RADIUS_MM, count), rng.uniform(-1.5, 1.5, count)
    radius = np.sqrt(surface.RADIUS_MM**2 - np.maximum(x, 0.0) ** 2)
    point = np.column_stack([x, radius * np.sin(angle), -radius * np.cos(angle)])
    normal = surface.normals_at(point)
    pressed = rng.uniform(0.5, 20.0, (count, 1))
    shear = rng.normal(0.0, 0.25, (count, 3)) * pressed
    shear -= (shear * normal).sum(axis=1, keepdims=True) * normal
    torsion: Floats = rng.normal(0.0, 5.0, count)
    return point, shear - pressed * normal, torsion


def _error(noise: str, method: str, off: Floats) -> ContactError:
    distance = np.linalg.norm(off[np.isfinite(off).all(axis=1)], axis=1)
    return ContactError(
        noise,
        method,
        len(distance),
        float(np.sqrt((distance**2).mean())),
        float(np.percentile(distance, 95)),
        float(distance.max()),
    )
