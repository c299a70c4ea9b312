"""What fingers felt of what was applied to them, where that is known."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

BANDS_N = (0.5, 1.0, 2.0, 5.0, 10.0)  # each up to the next one, the last one without an end


class Felt:
    """Means over frames by how much force was applied, and ``unfelt``: how many more of them have no force."""

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

    def __str__(self) -> str:
        means = ((b["felt_n"], np.linalg.norm(b["rmse_n"]), b["applied_n"]) for b in self.bands)
        parts = ["{:.2f} ± {:.2f} of {:.2f} N".format(*mean) for mean in means]
        return ", ".join([*parts, *([f"nothing in {self.unfelt} frames without a force"] if self.unfelt else [])])
