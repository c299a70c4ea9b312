"""The point of contact from a force plate: it follows from a wrench and the core's shape.

A point contact carries a force f and a torsion K about the surface's normal n, so the moment about the origin is
m = c x f + K n with c on the half-cylinder (x <= 0) or the quarter-sphere. There are as many unknowns as equations,
which have a closed form. The paper searches a 0.5 mm mesh instead (Eq 5 to 7), which alone is off by
a quarter of a millimetre. Pure functions; lengths in mm, forces in N on the finger, moments in N mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...core import geometry as surface
from ...errors import RecordingError
from ...kernels.geometry import Floats

MESH_STEP_MM = 0.5


@dataclass(frozen=True)
class Contact:
    """n contacts; NaN where the wrench has none.

    ``point_mm`` (n, 3) is on the core, ``normal`` (n, 3) points outward, ``normal_force_n`` (n,) >= 0 is into the
    finger, ``torsion_nmm`` (n,) is about the outward normal. ``missed`` (n,) is true where the line of action passes
    beside the cylinder (noise at a grazing contact, or a second contact), so that there is no point. ``on_skin`` (n,)
    is true where the point is on the ventral surface between its proximal end and the tip.
    """

    point_mm: Floats
    normal: Floats
    normal_force_n: Floats
    torsion_nmm: Floats
    missed: npt.NDArray[np.bool_]
    on_skin: npt.NDArray[np.bool_]


def moment(point_mm: Floats, force_n: Floats, torsion_nmm: Floats) -> Floats:
    """Moment (n, 3) about the origin for contacts at ``point_mm`` (n, 3): the inverse of locate()."""
    normal = surface.normals_at(point_mm)
    return np.cross(point_mm, force_n) + torsion_nmm[:, None] * normal


def locate(force_n: Floats, moment_nmm: Floats) -> Contact:
    """Contacts from forces (n, 3) and moments about the origin (n, 3). A force of 0, or NaN, gives NaN."""
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

    (K - a [f]x) n = m is split into the parts along f and across it. Neither divides by K, so a contact without
    torsion is no special case.
    """
    a = surface.RADIUS_MM
    ff, mm, mf = (f * f).sum(axis=1), (m * m).sum(axis=1), (m * f).sum(axis=1)
    b = mm - a * a * ff
    root = np.hypot(b, 2.0 * a * mf)
    # K^2 and (f.n)^2 can each be written in two ways: this takes the one without cancellation
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
    """Point, outward normal, torsion, and whether m_x is larger than f can cause, on the endless cylinder."""
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


def locate_on_mesh(force_n: Floats, moment_nmm: Floats) -> Floats:
    """The paper's method: the mesh point (n, 3) with the least |n x (m - c x f)| of those that the force presses on.

    NaN where it presses on none.
    """
    points, normals, _ = surface.ventral_mesh(MESH_STEP_MM)
    result = np.full((len(force_n), 3), np.nan)
    for k, (f, m) in enumerate(zip(force_n, moment_nmm, strict=True)):
        left = np.linalg.norm(np.cross(normals, m - np.cross(points, f)), axis=1)
        left[~(normals @ f < 0.0)] = np.inf
        best = int(np.argmin(left))
        if np.isfinite(left[best]):
            result[k] = points[best]
    return result


LIGHT_N = 0.5  # a lighter contact has hardly any torsion: at most friction times force times half the contact's width
MAX_NOWHERE_SHARE = 0.01
MAX_OFF_MM = 2.0  # a line of action may pass the core at this distance and still touch the skin over it


def torsion_truth(
    where: object, given: npt.NDArray[Any] | None, force_n: Floats, moment_nmm: Floats
) -> tuple[Floats, tuple[str, ...]]:
    """Torsion (n, 1) in N mm about the outward normal, or (n, 0) where it cannot be determined, and notes.

    It is an axis of the map of its own: torque about the origin is mostly the force's lever, and subtracting c x F from
    it leaves the point of contact's error times the force (three times a good map's error).

    ``given`` (n,) is the recording's own torsion; without it, it is computed from the wrench as of a point contact.
    Raises RecordingError when ``given`` is not one finite number for each row.
    """
    rows = len(force_n)
    if given is not None:
        if given.shape != (rows,) or given.dtype.kind not in "iuf" or not np.isfinite(given).all():
            raise RecordingError(
                f"{where}: field torsion is {given.dtype} {given.shape}: expected ({rows},) finite numbers in N mm "
                f"about the outward normal, one per frame; omit it to have it computed from F and M"
            )
        return given.astype(np.float64)[:, None], ()
    size = np.linalg.norm(force_n, axis=1)
    firm = size >= LIGHT_N
    torsion = np.zeros(rows)
    found = locate(force_n[firm], moment_nmm[firm])
    torsion[firm] = found.torsion_nmm
    missed = firm.copy()
    missed[firm] = found.missed | ~found.on_skin
    # there, at the mesh point that fits best, unless even that is off by more than MAX_OFF_MM
    force, point = force_n[missed], locate_on_mesh(force_n[missed], moment_nmm[missed])
    normal, about = surface.normals_at(point), moment_nmm[missed] - np.cross(point, force)
    off_mm = np.linalg.norm(np.cross(normal, about), axis=1) / np.linalg.norm(force, axis=1)
    torsion[missed] = np.where(off_mm <= MAX_OFF_MM, (about * normal).sum(axis=1), np.nan)
    nowhere = ~np.isfinite(torsion)
    note = f"torsion: from F and M of point contacts; the line of action misses the finger in {missed.sum()} rows"
    if nowhere.sum() > MAX_NOWHERE_SHARE * rows:
        return np.zeros((rows, 0)), (f"{note}, in {nowhere.sum()} of which no contact fits: torsion is left out",)
    torsion[nowhere] = 0.0
    return torsion[:, None], (note,)
