"""Where a force plate says a finger is touched: a wrench and the core's shape give the point of contact.

A point contact carries a force f and a torsion K about the surface's normal n, so the moment about
the origin is m = c x f + K n with c on the half-cylinder (x <= 0) or the quarter-sphere. That is as
many unknowns as equations, and numerics.md 5.1 solves it in closed form; the paper searches a 0.5 mm
mesh instead (Eq 5 to 7), which by itself is off by a quarter of a millimetre. Pure functions; lengths
in mm, forces in N on the finger, moments in N mm.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...core import geometry as surface
from ...core.geometry import Floats

MESH_STEP_MM = 0.5


@dataclass(frozen=True)
class Contact:
    """n contacts; NaN where the wrench has none.

    ``point_mm`` (n, 3) on the core, ``normal`` (n, 3) outward, ``normal_force_n`` (n,) >= 0 into the
    finger, ``torsion_nmm`` (n,) about the outward normal. ``missed`` (n,): the line of
    action passes beside the cylinder (noise at a grazing contact, or a second contact), so there is no
    point. ``on_skin`` (n,): the point is on the ventral surface between its proximal end and the tip.
    """

    point_mm: Floats
    normal: Floats
    normal_force_n: Floats
    torsion_nmm: Floats
    missed: npt.NDArray[np.bool_]
    on_skin: npt.NDArray[np.bool_]


def moment(point_mm: Floats, force_n: Floats, torsion_nmm: Floats) -> Floats:
    """Moment (n, 3) about the origin of contacts at ``point_mm`` (n, 3): the forward computation."""
    normal = surface.normals_at(point_mm)
    result: Floats = np.cross(point_mm, force_n) + torsion_nmm[:, None] * normal
    return result


def locate(force_n: Floats, moment_nmm: Floats) -> Contact:
    """Contacts from forces (n, 3) and moments about the origin (n, 3). No force, or NaN, gives NaN."""
    force, torque = np.asarray(force_n, dtype=np.float64), np.asarray(moment_nmm, dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        on_sphere, sphere_torsion = _sphere(force, torque)
        on_cylinder, normal, cylinder_torsion, missed = _cylinder(force, torque)
        cap = on_sphere[:, 0] >= 0.0
        point = np.where(cap[:, None], surface.RADIUS_MM * on_sphere, on_cylinder)
        normal = np.where(cap[:, None], on_sphere, normal)
        torsion = np.where(cap, sphere_torsion, cylinder_torsion)
    pressed = -(force * normal).sum(axis=1)
    known = np.isfinite(point).all(axis=1) & np.isfinite(torsion) & np.isfinite(pressed)
    nowhere = np.where(known, 1.0, np.nan)
    on_skin = known & (point[:, 0] >= surface.PROXIMAL_END_MM) & (normal[:, 2] <= 0.0)
    return Contact(
        point * nowhere[:, None], normal * nowhere[:, None], pressed * nowhere, torsion * nowhere,
        missed & ~cap, on_skin,
    )  # fmt: skip


def _sphere(f: Floats, m: Floats) -> tuple[Floats, Floats]:
    """Outward normal (n, 3) and torsion (n,) as if the whole core were the sphere.

    (K - a [f]x) n = m, split into the part along f and the part across: neither divides by K, so a
    contact without torsion is no special case.
    """
    a = surface.RADIUS_MM
    ff, mm, mf = (f * f).sum(axis=1), (m * m).sum(axis=1), (m * f).sum(axis=1)
    b = mm - a * a * ff
    root = np.hypot(b, 2.0 * a * mf)
    # of the two ways to write K^2 and (f.n)^2, each time the one without cancellation
    large = (np.abs(b) + root) / 2.0
    small = np.where(large > 0.0, (a * mf) ** 2 / large, 0.0)
    k2 = np.where(b > 0.0, large, small)
    fn = -np.sqrt(np.where(b > 0.0, small, large)) / a  # outward n: the force presses
    k = -np.sqrt(k2) * np.where(mf < 0.0, -1.0, 1.0)
    along = f * (mf / ff)[:, None]
    across = m - along
    n = (k[:, None] * across + a * np.cross(f, across)) / (k2 + a * a * ff)[:, None] + f * (fn / ff)[:, None]
    return n, k


def _cylinder(f: Floats, m: Floats) -> tuple[Floats, Floats, Floats, npt.NDArray[np.bool_]]:
    """Point, outward normal, torsion, and whether m_x is more than f can have there, on the endless cylinder."""
    a = surface.RADIUS_MM
    across = np.hypot(f[:, 1], f[:, 2])
    sine = m[:, 0] / (a * across)
    missed = np.abs(sine) > 1.0
    cosine = np.sqrt((1.0 - sine) * (1.0 + sine))  # NaN beyond
    uy, uz = f[:, 1] / across, f[:, 2] / across
    ny, nz = sine * uz - cosine * uy, -sine * uy - cosine * uz
    y = m[:, 1] - a * nz * f[:, 0]
    z = m[:, 2] + a * ny * f[:, 0]
    determinant = across * cosine  # -(f.n)
    x = (y * nz - z * ny) / determinant
    k = -(f[:, 1] * y + f[:, 2] * z) / determinant
    point = np.column_stack([x, a * ny, a * nz])
    return point, np.column_stack([np.zeros_like(x), ny, nz]), k, missed


def locate_on_mesh(force_n: Floats, moment_nmm: Floats, step_mm: float = MESH_STEP_MM) -> Floats:
    """The paper's way: the mesh point (n, 3) where |n x (m - c x f)| is least among those the force presses on.

    NaN where it presses on none.
    """
    points, normals, _ = surface.ventral_mesh(step_mm)
    result = np.full((len(force_n), 3), np.nan)
    for k, (f, m) in enumerate(zip(force_n, moment_nmm, strict=True)):
        left = np.linalg.norm(np.cross(normals, m - np.cross(points, f)), axis=1)
        left[~(normals @ f < 0.0)] = np.inf
        best = int(np.argmin(left))
        if np.isfinite(left[best]):
            result[k] = points[best]
    return result
