"""How well a wrench says where a finger is touched: closed form against the paper's mesh, on random contacts."""

from __future__ import annotations

from typing import Any

import numpy as np

from biotac.calibrate.wrench import MESH_STEP_MM, locate, locate_on_mesh, moment
from biotac.core import geometry as surface

from ..report import Options, Report, Table
from .trial import Floats

CONTACTS = 4000
# Noise added to the wrench, in N and N mm: none, a Nano17's resolution, and that of a worse plate.
NOISES = (("exact wrench", 0.0, 0.0), ("Nano17's resolution", 1 / 320, 1 / 64), ("20 mN, 0.2 N mm", 0.02, 0.2))


def run(options: Options) -> Report:
    """Errors of both methods with every noise of NOISES, on random contacts with shear and torsion."""
    rng = np.random.default_rng(options.seed)
    point, force, torsion = random_contacts(CONTACTS, rng)
    torque = moment(point, force, torsion)
    off: dict[tuple[str, str], Floats] = {}
    for name, force_n, torque_nmm in NOISES:
        options.show(name)
        read_f = force + rng.normal(0.0, 1.0, force.shape) * force_n
        read_m = torque + rng.normal(0.0, 1.0, torque.shape) * torque_nmm
        closed = locate(read_f, read_m)
        found = {
            "closed form": np.where(closed.missed[:, None], np.nan, closed.point_mm),
            f"mesh of {MESH_STEP_MM:g} mm": locate_on_mesh(read_f, read_m),
        }
        for method, points in found.items():
            distance = np.linalg.norm(points - point, axis=1)
            off[name, method] = distance[np.isfinite(distance)]
    rows = [
        [*names, float(np.sqrt((mm**2).mean())), float(np.percentile(mm, 95)), float(mm.max()), len(mm)]
        for names, mm in off.items()
    ]
    text = "Distance in mm from the true contact; one that noise puts beside the finger has no point and is not found."
    table = Table("Contacts", ["wrench", "method", "RMS", "p95", "max", "found"], rows, text, digits=4)
    return Report(f"{CONTACTS} random contacts", [table], [], [], lambda figure: _draw(off, figure))


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


def _draw(off: dict[tuple[str, str], Floats], figure: Any) -> None:
    """Shares of contacts by distance."""
    axes = figure.subplots()
    for names, distance in off.items():
        mm = np.maximum(np.sort(distance), 1e-12)
        axes.plot(mm, (np.arange(len(mm)) + 0.5) / len(mm), label=", ".join(names))
    axes.set(
        xscale="log", xlabel="distance from the true contact [mm]", ylabel="share of contacts within this distance"
    )
    axes.legend(fontsize=8)
    axes.grid(alpha=0.25)
