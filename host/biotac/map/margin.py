"""How far a force may be off: the margin of the 95 % interval, as it is fitted, stored and applied (SPEC.md, Grip)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from ..kernels.geometry import Floats, grip_parts
from ..wire import messages_gen as wire

#: Edges of the bands of force in N in which an interval is checked, and how many rows a band needs for that.
BANDS_N = (0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0)
BAND_ROWS = 200
WITHIN, WITHIN_BAND = 0.96, 0.87  # shares of the rows that a margin is fitted to: over all, and in each band
PARTS = ("normal", "shear")
_MN_PER_N, _SHARES = 1000.0, 256
_STEPS = np.arange(0, _SHARES, 4) / _SHARES
_LEAST_N = 0.02


@dataclass(frozen=True)
class Margin:
    """``base_mn`` and ``share_q8``, each of normal and shear: a half width is the base and the share, in 1/256, of the
    sum of both parts. A base of 65535 is unknown.
    """

    base_mn: tuple[int, int]
    share_q8: tuple[int, int]

    def half_n(self, parts_n: Floats) -> Floats:
        """Half widths (n, 2) in N for normal and shear ``parts_n`` (n, 2); NaN where unknown."""
        base = np.where(np.array(self.base_mn) == wire.INVALID_COUNT, np.nan, np.array(self.base_mn) / _MN_PER_N)
        half: Floats = base + parts_n.sum(axis=1, keepdims=True) * np.array(self.share_q8) / _SHARES
        return half


UNKNOWN = Margin((wire.INVALID_COUNT,) * 2, (0, 0))


def published_parts(force_n: Floats, poc_mm: Floats) -> Floats:
    """grip_parts() as a board publishes them: where the force would pull, normal is 0."""
    parts = grip_parts(force_n, poc_mm)
    return np.column_stack([np.maximum(parts[:, 0], 0.0), parts[:, 1]])


def bands(force_n: Floats) -> Iterator[tuple[str, npt.NDArray[np.bool_]]]:
    """The bands with at least BAND_ROWS rows of forces (n, 3): the band's name, and the rows (n,) in it."""
    size = np.linalg.norm(force_n, axis=1)
    for low, high in pairwise(BANDS_N):
        rows = (size >= low) & (size < high)
        if rows.sum() >= BAND_ROWS:
            yield f"{low:g}-{high:g}", rows


def fit_margin(felt_n: Floats, truth_n: Floats, force_n: Floats, guess_n: Floats | float = 0.0) -> Margin:
    """The narrowest margin for parts ``felt_n`` (n, 2) of a source on rows that it had not seen.

    ``truth_n`` (n, 2) are the true parts, ``force_n`` (n, 3) the true force, ``guess_n`` (n, 2) the source's own part
    of the half width. Of the rows above BANDS_N[0], WITHIN are in the interval, and WITHIN_BAND of each band. UNKNOWN
    with fewer than BAND_ROWS of these.
    """
    touched = np.isfinite(felt_n).all(axis=1) & (np.linalg.norm(force_n, axis=1) >= BANDS_N[0])
    if touched.sum() < BAND_ROWS:
        return UNKNOWN
    size = felt_n[touched].sum(axis=1)
    left = np.abs(felt_n - truth_n)[touched] - (guess_n[touched] if isinstance(guess_n, np.ndarray) else guess_n)
    band_rows = [rows for _, rows in bands(force_n[touched])]
    base, share = [], []
    width = np.mean([np.median(size[rows]) for rows in band_rows]) if band_rows else np.median(size)
    for part in range(len(PARTS)):
        tried = []
        for step in _STEPS:
            rest = left[:, part] - step * size
            needed = [np.quantile(rest, WITHIN), *(np.quantile(rest[rows], WITHIN_BAND) for rows in band_rows)]
            least = max(_LEAST_N, *map(float, needed))
            tried.append((least + step * float(width), least, step))
        _, least, step = min(tried)
        base.append(min(int(np.ceil(least * _MN_PER_N)), wire.INVALID_COUNT - 1))
        share.append(round(step * _SHARES))
    return Margin((base[0], base[1]), (share[0], share[1]))
