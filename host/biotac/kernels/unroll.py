"""The fingertip's surface laid flat, for every picture of it: a half cylinder with a quarter of a sphere as its tip."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .geometry import RADIUS_MM, Floats


def unroll(points_mm: NDArray[Any]) -> tuple[Floats, Floats]:
    """Arc lengths (n,) of surface points (n, 3), in mm: across, from the ventral line, and along the finger."""
    x, y, z = points_mm.T
    across = RADIUS_MM * np.arctan2(y, -z)
    along = np.where(x > 0, RADIUS_MM * np.arcsin(np.clip(x / RADIUS_MM, 0, 1)), x)
    return across, along


def roll_up(across_mm: Floats, along_mm: Floats) -> Floats:
    """The surface points (n, 3) at such arc lengths (n,) in mm; unroll() takes them back."""
    cap = np.maximum(along_mm, 0.0) / RADIUS_MM
    roll, ring = across_mm / RADIUS_MM, RADIUS_MM * np.cos(cap)
    x = np.where(along_mm > 0.0, RADIUS_MM * np.sin(cap), along_mm)
    return np.column_stack([x, ring * np.sin(roll), -ring * np.cos(roll)])
