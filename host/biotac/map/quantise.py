"""From real coefficients to a board's 16 bits, with the largest exponents at which no sum on a board can overflow.

Whether one can is decided by firmware/core/map/open.c, which is asked.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..core.geometry import Floats
from ..errors import InputError
from ..wire import map_gen as _map
from ..wire.map_gen import Gate, Kind
from . import columns
from .board_map import BoardBlock, BoardMap, is_accepted
from .columns import AXES

#: Real coefficients (columns, axes) of each block, in the results' units.
Unrounded = Mapping[tuple[Kind, Gate], Floats]

# The board's factor for 1 in columns.kinds().
FACTOR = {
    "one": 2.0**_map.ONE_Q,
    "signal": 2.0**_map.SIGNAL_Q * columns.SIGNAL_COUNTS,
    "conductance": 2.0**_map.CONDUCTANCE_Q,
    "pressure": 2.0**_map.PRESSURE_Q * columns.PRESSURE_COUNTS,
}
COEFFICIENT_MAX = 2**15 - 1


def unit(kind: Kind, gate: Gate) -> float:
    """The result, in its units times 2^exponent, of a coefficient of 1 where column and gate are 1."""
    spec = _map.KINDS[kind]
    factor = FACTOR[spec.of]
    if spec.shape == "pairs":
        factor *= FACTOR[spec.of] / 2.0**_map.ROW_CUT
    return factor if gate == Gate.ONE else factor * 2.0 ** (_map.GATE_Q - _map.GATE_CUT)


def quantise(blocks: Unrounded, serial: str = "", made_s: int = 0) -> BoardMap:
    """The board's map of the ``blocks`` that are not all 0."""
    kept = tuple(_block(kind, gate, values) for (kind, gate), values in blocks.items() if np.any(values != 0.0))
    if not kept:
        raise InputError("every coefficient of the map is 0: expected a fitted map; calibrate again")
    axes = kept[0].coefficients.shape[1]
    size = _map.HEADER_BYTES + sum(_map.BLOCK_BYTES + 2 * axes * _map.KINDS[block.kind].halves for block in kept)
    if size > _map.MAX_BYTES:
        raise InputError(
            f"the map takes {size} bytes: expected at most {_map.MAX_BYTES}, which fit a board; choose a smaller model"
        )
    return BoardMap(axes, kept, serial, made_s)


def _block(kind: Kind, gate: Gate, values: Floats) -> BoardBlock:
    exponents, coefficients = [], []
    for axis in range(values.shape[1]):
        real = values[:, axis] / unit(kind, gate)
        for exponent in range(_map.EXPONENT_MAX, 0, -1):
            scaled = np.rint(real * 2.0**exponent)
            if np.abs(scaled).max() <= COEFFICIENT_MAX and _fits(kind, gate, scaled.astype(np.int64), exponent):
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
