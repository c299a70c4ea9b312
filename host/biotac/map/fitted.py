"""A wrench map as it was fitted, in float64."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..core.geometry import Floats
from ..errors import InputError
from ..wire.map_gen import Gate, Kind
from . import columns
from .board_map import BoardMap
from .columns import ELECTRODES, Signals, with_one
from .float64 import result_units
from .quantise import Unrounded, quantise


@dataclass(frozen=True)
class WrenchMap:
    """A map from one frame's counts to force on the finger, and where calibrated torque about Lin's origin and torsion.

    ``coefficients`` (p + 1, axes) are for columns.columns(), block by block, the offset last; ``tare`` (19,) is in
    counts. The map was trained on mean counts of ``window_rows`` frames, which lag the force by ``lag_rows`` (axes,).
    """

    model: str
    axes: tuple[str, ...]
    tare: Floats
    window_rows: int
    lag_rows: tuple[int, ...]
    coefficients: Floats

    @property
    def with_pdc(self) -> bool:
        """Whether the map was trained with PDC, and so needs it."""
        return len(self.coefficients) - 1 == columns.width(with_pdc=True)

    def predict(self, counts: Floats, pdc: Floats | None = None) -> Floats:
        """Wrench (n, axes) in N and N mm for each of ``counts`` (n, 19); NaN where a count is NaN.

        The caller averages the counts over ``window_rows``. ``pdc`` (n,) is in counts above rest. Raises InputError
        when the map was trained with PDC and there is none.
        """
        if self.with_pdc and pdc is None:
            raise InputError(
                "this map was trained with PDC: expected pdc (n,) too; pass it, or calibrate without field PDC"
            )
        signals = Signals(np.asarray(counts, dtype=np.float64) - self.tare, self.tare, pdc if self.with_pdc else None)
        return with_one(columns.columns(signals)) @ self.coefficients

    def blocks(self) -> Unrounded:
        """The coefficients of each block, in the board's units for results."""
        scaled = self.coefficients * result_units(len(self.axes))
        found = columns.split(columns.blocks(with_pdc=self.with_pdc), scaled)
        found[Kind.OFFSET, Gate.ONE] = scaled[-1:]
        # e = min(e, 0) + max(e, 0): where both are present anyway, this saves a block
        split = [(kind, Gate.ONE) for kind in columns.SPLIT]
        if all(np.any(found[part] != 0.0) for part in split):
            signal = found.pop((Kind.SIGNAL, Gate.ONE))
            found |= {part: found[part] + signal for part in split}
        return found

    def on_board(self, *, serial: str = "", made_s: int = 0) -> BoardMap:
        """The map for a board. Raises InputError, as quantise(), for one that no board can hold."""
        return quantise(self.blocks(), serial, made_s)

    def to_dict(self) -> dict[str, Any]:
        """The map as JSON types; from_dict() gives exactly the same numbers."""
        return {
            "model": self.model,
            "axes": list(self.axes),
            "tare_counts": self.tare.tolist(),
            "window_rows": self.window_rows,
            "lag_rows": list(self.lag_rows),
            "blocks": _block_names(with_pdc=self.with_pdc),
            "coefficients": self.coefficients.tolist(),
        }

    @classmethod
    def from_dict(cls, facts: dict[str, Any]) -> WrenchMap:
        """Inverse of to_dict. Raises ValueError, KeyError, TypeError or OverflowError for anything else."""
        fitted = cls(
            str(facts["model"]),
            tuple(str(axis) for axis in facts["axes"]),
            np.array(facts["tare_counts"], dtype=np.float64),
            int(facts["window_rows"]),
            tuple(int(lag) for lag in facts["lag_rows"]),
            np.array(facts["coefficients"], dtype=np.float64),
        )
        shapes = [(columns.width(with_pdc=pdc) + 1, len(fitted.axes)) for pdc in (False, True)]
        if fitted.coefficients.shape not in shapes or fitted.tare.shape != (ELECTRODES,):
            raise ValueError(f"its coefficients have shape {fitted.coefficients.shape}, its tare {fitted.tare.shape}")
        if len(fitted.lag_rows) != len(fitted.axes):
            raise ValueError(f"it has {len(fitted.lag_rows)} lags for {len(fitted.axes)} axes")
        if facts["blocks"] != _block_names(with_pdc=fitted.with_pdc):
            raise ValueError(f"its blocks are {facts['blocks']}")
        if not np.isfinite(fitted.coefficients).all() or not np.isfinite(fitted.tare).all():
            raise ValueError("a coefficient or tare is not finite")
        return fitted


def _block_names(*, with_pdc: bool) -> list[list[str]]:
    return [[kind.name, gate.name] for kind, gate in columns.blocks(with_pdc=with_pdc)]
