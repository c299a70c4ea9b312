"""The forces that fingers read, against the forces that were applied, where those are known."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

BANDS_N = (0.5, 1.0, 2.0, 5.0, 10.0)  # each up to the next one, the last one without an end


class Felt:
    """Means over frames by size of the applied force, and ``unfelt``: how many more of them have no force."""

    def __init__(self) -> None:
        self._sums, self.unfelt = np.zeros((len(BANDS_N), 6)), 0

    def add(self, applied_n: NDArray[np.float64], felt_n: NDArray[np.float64]) -> None:
        """Add frames: the force on a finger and the one computed, both (n, 3) in N, NaN where not known."""
        size = np.sqrt((applied_n**2).sum(axis=1))
        along = (applied_n * felt_n).sum(axis=1) / np.maximum(size, BANDS_N[0])
        band, known = np.searchsorted(BANDS_N, size, "right") - 1, np.isfinite(along)
        each = np.column_stack([known, size, along, (felt_n - applied_n) ** 2])
        np.add.at(self._sums, band[known & (band >= 0)], each[known & (band >= 0)])
        self.unfelt += int((~known & (size >= BANDS_N[0])).sum())

    @property
    def bands(self) -> list[dict[str, Any]]:
        """Of those of BANDS_N with ``frames``: means ``applied_n`` and, along it, ``felt_n``; ``rmse_n`` (3,), in N."""
        each = ((low, int(row[0]), row[1:] / row[0]) for low, row in zip(BANDS_N, self._sums, strict=True) if row[0])
        return [
            {"from_n": low, "frames": n, "applied_n": size, "felt_n": along, "rmse_n": np.sqrt(squares).tolist()}
            for low, n, (size, along, *squares) in each
        ]


def table(felt: Mapping[str, Felt]) -> list[str]:
    """Lines of a table in N by the names in ``felt``: applied force, reading along it, and the vector's RMS error."""
    bands = [{band["from_n"]: band for band in one.bands} for one in felt.values()]
    rows = []
    for low in BANDS_N:
        found = [band.get(low) for band in bands]
        means = [f"{b['felt_n']:8.2f}{np.linalg.norm(b['rmse_n']):8.2f}" if b else " " * 16 for b in found]
        rows += [f"{b['applied_n']:10.2f}  {'  '.join(means)}" for b in found if b][:1]
    unfelt = [f"{name}: no force in {one.unfelt} more frames" for name, one in felt.items() if one.unfelt]
    head = [" " * 12 + "  ".join(f"{name:>16}" for name in felt)] if len(felt) > 1 else []
    head += ["applied, N" + "      read   error" * len(felt)]
    return [*(head if rows else []), *rows, *unfelt]
