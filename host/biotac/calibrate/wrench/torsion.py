"""The torsion about the normal at the contact, as truth for a calibration.

It is a row of the map of its own: torque about the origin is mostly the force's lever, and what is left after
taking c x F away again is the point of contact's error times the force (three times a good map's error).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ...core import geometry as surface
from ...core.geometry import Floats
from ...errors import RecordingError
from .contact import locate, locate_on_mesh

LIGHT_N = 0.5  # a lighter contact holds no torsion to speak of: friction times force times half its width
MAX_NOWHERE_SHARE = 0.01
MAX_OFF_MM = 2.0  # how far beside the core a line of action may pass and still be a touch of the skin over it


def truth(
    where: object, given: npt.NDArray[Any] | None, force_n: Floats, moment_nmm: Floats
) -> tuple[Floats, tuple[str, ...]]:
    """Torsion (n, 1) in N mm about the outward normal, or (n, 0) where there is none to be had, and notes.

    ``given`` (n,) is the recording's own, else it follows from the wrench on a point contact. Raises
    RecordingError when ``given`` is no number a row.
    """
    rows = len(force_n)
    if given is not None:
        if given.shape != (rows,) or given.dtype.kind not in "iuf" or not np.isfinite(given).all():
            raise RecordingError(
                f"{where}: field torsion is {given.dtype} {given.shape}: expected ({rows},) finite numbers in N mm "
                f"about the outward normal, a row a frame; leave it out to have it computed from F and M"
            )
        return given.astype(np.float64)[:, None], ()
    size = np.linalg.norm(force_n, axis=1)
    firm = size >= LIGHT_N
    torsion = np.zeros(rows)
    found = locate(force_n[firm], moment_nmm[firm])
    torsion[firm] = found.torsion_nmm
    missed = firm.copy()
    missed[firm] = found.missed | ~found.on_skin
    torsion[missed] = _on_mesh(force_n[missed], moment_nmm[missed])
    nowhere = ~np.isfinite(torsion)
    note = f"torsion: from F and M of point contacts; the line of action misses the finger in {missed.sum()} rows"
    if nowhere.sum() > MAX_NOWHERE_SHARE * rows:
        return np.zeros((rows, 0)), (f"{note}, {nowhere.sum()} press on no place of it: torsion is left out",)
    torsion[nowhere] = 0.0
    return torsion[:, None], (note,)


def _on_mesh(force_n: Floats, moment_nmm: Floats) -> Floats:
    """Torsion (n,) at the mesh point that fits best; NaN where none explains the moment to MAX_OFF_MM."""
    point = locate_on_mesh(force_n, moment_nmm)
    normal = surface.normals_at(point)
    about = moment_nmm - np.cross(point, force_n)
    off_mm = np.linalg.norm(np.cross(normal, about), axis=1) / np.linalg.norm(force_n, axis=1)
    return np.where(off_mm <= MAX_OFF_MM, (about * normal).sum(axis=1), np.nan)
