"""Navarro et al. 2015, Eq 1 to 6, in float64: what the board's integers and every calibration answer to."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def filtered(pdc: Any, alpha: float) -> Floats:
    """Eq 3 over ``pdc`` (n,) in counts: P_0 = p_0, P_i = alpha p_i + (1 - alpha) P_{i-1}; alpha in (0, 1].

    NaN stands for a missing or railed word: it gives NaN, and the next good one begins anew.
    """
    words = np.asarray(pdc, np.float64)
    out = np.full(len(words), np.nan)
    state = np.nan
    for k, word in enumerate(words.tolist()):
        state = word if np.isnan(state) or np.isnan(word) else alpha * word + (1.0 - alpha) * state
        out[k] = state
    return out


def force(pressure: Any, rest: Any, gain_n: float) -> Floats:
    """Eq 1: (P - P0) K; pressure and rest in counts, ``gain_n`` in N per count, N out."""
    return np.asarray((np.asarray(pressure, np.float64) - rest) * gain_n, np.float64)


def magnitude(force_n: Any) -> Floats:
    """Eq 2: |F| of (n, 3)."""
    return np.asarray(np.sqrt((np.asarray(force_n, np.float64) ** 2).sum(axis=-1)), np.float64)


def gain(above_rest: Any, force_n: Any) -> float:
    """Eq 6: K in N per count, the pseudo-inverse of the column P - P0 (n,) times F (n,) in N."""
    column = np.asarray(above_rest, np.float64).reshape(-1, 1)
    (solved,) = np.linalg.pinv(column) @ np.asarray(force_n, np.float64)
    return float(solved)


def relative_error(told_n: Any, force_n: Any) -> float:
    """|told - F| / |F| over a press, both (n,) in N and the bars Euclidean norms.

    The paper gives a "relative error" of 5.91 % without its formula. This one counts what a mean would hide: scatter
    from row to row is error, too.
    """
    truth = np.asarray(force_n, np.float64)
    return float(np.linalg.norm(np.asarray(told_n, np.float64) - truth) / np.linalg.norm(truth))
