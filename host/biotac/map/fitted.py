"""A wrench map as it was fitted, in float64, and from the coefficients to a board's 16 bits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InputError
from ..kernels.geometry import Floats
from ..wire import map_gen as _map
from ..wire.map_gen import Gate, Kind
from . import columns
from .board_map import BoardBlock, BoardMap, is_accepted
from .columns import AXES, ELECTRODES, Signals, with_one
from .float64 import Unrounded, result_units, unit
from .lesson import Lesson
from .margin import UNKNOWN, Margin

_COEFFICIENT_MAX = 2**15 - 1


@dataclass(frozen=True)
class WrenchMap:
    """A map from one frame's counts to force on the finger, and where calibrated torque about Lin's origin and torsion.

    ``coefficients`` (p + 1, axes) are for columns.columns(), block by block, the offset last; ``tare`` (19,) is in
    counts. The map was trained on mean counts of ``window_rows`` frames, which lag the force by ``lag_rows`` (axes,).
    ``margin`` is the force's on held-out rows, ``lesson`` describes the touches that the map was fitted to.
    """

    model: str
    axes: tuple[str, ...]
    tare: Floats
    window_rows: int
    lag_rows: tuple[int, ...]
    coefficients: Floats
    margin: Margin = UNKNOWN
    lesson: Lesson | None = None

    @property
    def with_pdc(self) -> bool:
        """Whether the map was trained with PDC, and so needs it."""
        return len(self.coefficients) - 1 == columns.width(columns.BLOCKS)

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
        return replace(quantise(self.blocks(), serial, made_s, self.margin), lesson=self.lesson)

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
            "margin": {"base_mn": list(self.margin.base_mn), "share_q8": list(self.margin.share_q8)},
            "lesson": None if self.lesson is None else self.lesson.to_dict(),
        }

    @classmethod
    def from_dict(cls, facts: dict[str, Any]) -> WrenchMap:
        """Inverse of to_dict. Raises ValueError, KeyError, TypeError or OverflowError for anything else."""
        margins = (facts["margin"][name] for name in ("base_mn", "share_q8"))
        base_mn, share_q8 = ((int(normal), int(shear)) for normal, shear in margins)
        fitted = cls(
            str(facts["model"]),
            tuple(str(axis) for axis in facts["axes"]),
            np.array(facts["tare_counts"], dtype=np.float64),
            int(facts["window_rows"]),
            tuple(int(lag) for lag in facts["lag_rows"]),
            np.array(facts["coefficients"], dtype=np.float64),
            Margin(base_mn, share_q8),
            Lesson.from_dict(facts.get("lesson")),
        )
        shapes = [(columns.width(columns.blocks(with_pdc=pdc)) + 1, len(fitted.axes)) for pdc in (False, True)]
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


def quantise(blocks: Unrounded, serial: str = "", made_s: int = 0, margin: Margin = UNKNOWN) -> BoardMap:
    """The board's map of the ``blocks`` that are not all 0, with the largest exponents at which no sum can overflow.

    Whether one can is decided by firmware/core/map/open.c, which is asked.
    """
    kept = tuple(_block(kind, gate, values) for (kind, gate), values in blocks.items() if np.any(values != 0.0))
    if not kept:
        raise InputError("every coefficient of the map is 0: expected a fitted map; calibrate again")
    return BoardMap(kept[0].coefficients.shape[1], kept, serial, made_s, margin)


def _block(kind: Kind, gate: Gate, values: Floats) -> BoardBlock:
    exponents, coefficients = [], []
    for axis in range(values.shape[1]):
        real = values[:, axis] / unit(kind, gate)
        for exponent in range(_map.EXPONENT_MAX, 0, -1):
            scaled = np.rint(real * 2.0**exponent)
            if np.abs(scaled).max() <= _COEFFICIENT_MAX and _fits(kind, gate, scaled.astype(np.int64), exponent):
                break
        else:
            raise InputError(
                f"coefficients of {kind.name} x {gate.name} for {AXES[axis]} add up to "
                f"{float(np.abs(scaled).sum()):.3g} units: too large for a board's 16-bit values or 32-bit sums; fit "
                "with more rows or a larger lambda"
            )
        exponents.append(exponent)
        coefficients.append(scaled.astype(np.int64))
    return BoardBlock(kind, gate, tuple(exponents), np.column_stack(coefficients))


def _fits(kind: Kind, gate: Gate, column: Floats, exponent: int) -> bool:
    """Whether a board accepts a map with this axis of a block alone; the other axes are 0."""
    alone = np.zeros((len(column), _map.AXES_FORCE), np.int64)
    alone[:, 0] = column
    return is_accepted(BoardMap(_map.AXES_FORCE, (BoardBlock(kind, gate, (exponent, 1, 1), alone),)))
