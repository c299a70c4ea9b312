"""Navarro et al. 2015, Eq 1, 2 and 6, in float64: the standard for the board's integers and for every calibration."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def force(pressure: Any, rest: Any, gain_n: float) -> Floats:
    """Eq 1: the force (P - P0) K in N, from pressure and rest in counts and ``gain_n`` in N per count."""
    return np.asarray((np.asarray(pressure, np.float64) - rest) * gain_n, np.float64)


def magnitude(force_n: Any) -> Floats:
    """Eq 2: magnitude |F| (n,) of forces (n, 3)."""
    return np.asarray(np.sqrt((np.asarray(force_n, np.float64) ** 2).sum(axis=-1)), np.float64)


def gain(above_rest: Any, force_n: Any) -> float:
    """Eq 6: K in N per count, the pseudo-inverse of the column P - P0 (n,) times F (n,) in N."""
    column = np.asarray(above_rest, np.float64).reshape(-1, 1)
    (solved,) = np.linalg.pinv(column) @ np.asarray(force_n, np.float64)
    return float(solved)


def relative_error(told_n: Any, force_n: Any) -> float:
    """|told - F| / |F| over a press, both (n,) in N; the bars are Euclidean norms.

    The paper gives a "relative error" of 5.91 % without its formula. This one includes what a mean would hide: scatter
    from row to row.
    """
    truth = np.asarray(force_n, np.float64)
    return float(np.linalg.norm(np.asarray(told_n, np.float64) - truth) / np.linalg.norm(truth))
