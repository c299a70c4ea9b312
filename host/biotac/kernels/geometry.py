"""The finger's core: electrode positions, the surface on which a contact lies, and a mesh over it.

Frame (Lin, Fishel and Loeb 2013, figure 4): x to the tip, y to E11's side, z dorsal, origin at the
centre of the tip sphere. The ventral surface is a half-cylinder (x <= 0) with a quarter-sphere cap
(x > 0), both of the core's radius (Eq 7). Lengths in mm, areas in mm^2.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..wire import sensor_gen as _sensor

Floats = npt.NDArray[np.float64]

RADIUS_MM = _sensor.CORE_RADIUS_UM / 1000.0
PROXIMAL_END_MM = -16.0  # the mesh, and so the model's fluid, ends here (host/docs/reference/sensor_model.md)
MESH_STEP_MM = 0.6

ELECTRODE_MM: Floats = np.array(_sensor.ELECTRODE_UM, dtype=np.float64) / 1000.0
ELECTRODE_NORMAL: Floats = np.array(_sensor.ELECTRODE_NORMAL_MILLI, dtype=np.float64) / 1000.0


def project(points_mm: Floats) -> Floats:
    """Move points (n, 3) radially onto the core surface (Eq 2, with the radius its text lost)."""
    points = np.array(points_mm, dtype=np.float64)
    on_cap = points[:, 0] > 0.0
    axial = np.where(on_cap, points[:, 0], 0.0)
    scale = RADIUS_MM / np.sqrt(axial**2 + points[:, 1] ** 2 + points[:, 2] ** 2)
    points[:, 1:] *= scale[:, None]
    points[on_cap, 0] *= scale[on_cap]
    return points


def point_of_contact(signals: npt.ArrayLike, exponent: float = 2.0, *, compressed: bool = False) -> Floats:
    """Lin 2013, Eq 1 and 2, for an exponent of any size: points (n, 3) in mm for signals (n, 19) in counts.

    NaN where no electrode has weight; one that is NaN has none. ``compressed`` counts only electrodes below their tare.
    An infinite exponent gives the strongest electrode, the mean of several alike. A board has n = 1 and 2
    (biotac.PocWeights); this is for comparison. Raises ValueError for other shapes, and exponents not above 0.
    """
    e = np.nan_to_num(np.asarray(signals, dtype=np.float64), nan=0.0)
    if e.ndim != 2 or e.shape[1] != len(ELECTRODE_MM) or not exponent > 0.0:
        raise ValueError(f"signals {e.shape}, exponent {exponent}: expected (n, {len(ELECTRODE_MM)}) and more than 0")
    size = np.maximum(-e, 0.0) if compressed else np.abs(e)
    most = size.max(axis=1, initial=0.0, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = (size / most) ** exponent  # of the strongest: a large power of a count would overflow
        return project(weight @ ELECTRODE_MM / weight.sum(axis=1, keepdims=True))


def on_surface(xy_mm: Floats) -> Floats:
    """Points (n, 3) of the ventral surface with the given x and y (n, 2)."""
    x, y = xy_mm[:, 0], xy_mm[:, 1]
    squared = RADIUS_MM**2 - np.maximum(x, 0.0) ** 2 - y**2
    # the edge z = 0 is part of the surface; rounding must not turn it into NaN
    return np.column_stack([x, y, -np.sqrt(np.maximum(squared, 0.0))])


def is_on_surface(x_mm: float, y_mm: float) -> bool:
    """Whether the ventral surface has a point with this x and y."""
    return x_mm >= PROXIMAL_END_MM and max(x_mm, 0.0) ** 2 + y_mm**2 <= RADIUS_MM**2


def normals_at(points_mm: Floats) -> Floats:
    """Outward unit normals (n, 3) of the core at surface points (n, 3)."""
    radial = np.array(points_mm, dtype=np.float64)
    radial[:, 0] = np.maximum(radial[:, 0], 0.0)
    unit: Floats = radial / np.linalg.norm(radial, axis=1, keepdims=True)
    return unit


def grip_parts(force_n: Floats, poc_mm: Floats) -> Floats:
    """Normal and shear part (n, 2) in N of forces (n, 3) on the finger at points of contact (n, 3).

    Normal is along the skin's inward normal; it is negative where the force would pull. NaN where a point is NaN.
    """
    outward = normals_at(poc_mm)
    along = (force_n * outward).sum(axis=1)
    return np.column_stack([-along, np.linalg.norm(force_n - along[:, None] * outward, axis=1)])


def tangents_at(normals: Floats) -> tuple[Floats, Floats]:
    """Tangent unit vectors (n, 3) "towards the tip" and "towards E11's side" at outward normals.

    They are the frame's x and y axes, turned by the shortest rotation that takes -z, the normal of
    the ventral midline, to the given normal; on the midline of the cylinder they are x and y.
    """
    nx, ny, nz = normals[:, 0], normals[:, 1], normals[:, 2]
    share = 1.0 / (1.0 - nz)  # the rotation is singular at nz = 1 only: dorsal, never a contact
    to_tip = np.column_stack([1.0 - nx * nx * share, -nx * ny * share, nx])
    to_side = np.column_stack([-nx * ny * share, 1.0 - ny * ny * share, ny])
    return to_tip, to_side


def ventral_mesh(step_mm: float = MESH_STEP_MM) -> tuple[Floats, Floats, Floats]:
    """Quadrature points (m, 3), normals (m, 3) and areas (m,) of the ventral surface.

    Mirror-symmetric in y, so that a mirrored contact displaces exactly the same volume.
    """
    points: list[Floats] = []
    areas: list[Floats] = []

    def ring(x_mm: float, ring_radius_mm: float, area_mm2: float) -> None:
        cells = max(1, round(np.pi * ring_radius_mm / step_mm))
        angle = (np.arange(cells) + 0.5) * np.pi / cells - np.pi / 2
        y, z = ring_radius_mm * np.sin(angle), -ring_radius_mm * np.cos(angle)
        points.append(np.column_stack([np.full(cells, x_mm), y, z]))
        areas.append(np.full(cells, area_mm2 / cells))

    rings = round(-PROXIMAL_END_MM / step_mm)
    width = -PROXIMAL_END_MM / rings
    for k in range(rings):
        ring(PROXIMAL_END_MM + (k + 0.5) * width, RADIUS_MM, np.pi * RADIUS_MM * width)
    rings = round(np.pi / 2 * RADIUS_MM / step_mm)
    for k in range(rings):
        low, high = (np.sin(edge * np.pi / 2 / rings) for edge in (k, k + 1))
        middle = np.sin((k + 0.5) * np.pi / 2 / rings)
        # Archimedes: a band of a sphere has the area of the cylinder around it
        area = np.pi * RADIUS_MM**2 * float(high - low)
        ring(RADIUS_MM * float(middle), RADIUS_MM * float(np.sqrt(1.0 - middle**2)), area)
    mesh = np.concatenate(points)
    return mesh, normals_at(mesh), np.concatenate(areas)
