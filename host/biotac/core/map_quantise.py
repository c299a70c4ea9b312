"""From real coefficients to a board's: 16 bits, with exponents at which no sum on a board can overflow.

The bounds are those of firmware/core/map/open.c, which decides: a block gets the largest exponent that passes them.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..wire import map_gen as _map
from ..wire import sensor_gen as _sensor
from ..wire.map_gen import Gate, Kind
from . import map_columns as columns
from .board_map import RING, BoardBlock, Integers
from .geometry import Floats

# The board's factor for 1 in map_columns, and below the largest factor possible.
FACTOR = {
    "one": 2.0**_map.ONE_Q,
    "signal": 2.0**_map.SIGNAL_Q * columns.SIGNAL_COUNTS,
    "conductance": 2.0**_map.CONDUCTANCE_Q,
    "pressure": 2.0**_map.PRESSURE_Q * columns.PRESSURE_COUNTS,
}
_MOST = {
    "one": 2**_map.ONE_Q,
    "signal": _sensor.FULL_SCALE_COUNT << _map.SIGNAL_Q,
    "conductance": _map.RATIO_MAX << _map.CONDUCTANCE_Q,
    "pressure": _sensor.FULL_SCALE_COUNT << _map.PRESSURE_Q,
}
_LARGEST = 2**31 - 1


def unit(kind: Kind, gate: Gate) -> float:
    """The result, in its units times 2^exponent, of a coefficient of 1 where column and gate are 1."""
    spec = _map.KINDS[kind]
    its = FACTOR[spec.of]
    if spec.shape == "pairs":
        its *= FACTOR[spec.of] / 2.0**_map.ROW_CUT
    return its if gate == Gate.ONE else its * 2.0 ** (_map.GATE_Q - _map.GATE_CUT)


def block(kind: Kind, gate: Gate, values: Floats, names: tuple[str, ...]) -> BoardBlock:
    """The block for ``values`` (columns, axes), in the results' units for map_columns' columns and gates.

    Raises InputError, with the axis from ``names``, when its coefficients do not fit the formats.
    """
    exponents, whole = [], []
    for axis, name in enumerate(names):
        its = values[:, axis] / unit(kind, gate)
        for exponent in range(_map.EXPONENT_MAX, 0, -1):
            scaled = np.rint(its * 2.0**exponent)
            if _fits(kind, gate, np.abs(scaled), exponent):
                break
        else:
            raise InputError(
                f"coefficients of {kind.name} x {gate.name} for {name} add up to {float(np.abs(scaled).sum()):.3g} "
                "units: too large for a board's 16-bit values or 32-bit sums; fit with more rows or a larger lambda"
            )
        exponents.append(exponent)
        whole.append(scaled.astype(np.int64))
    return BoardBlock(kind, gate, tuple(exponents), np.column_stack(whole))


def _fits(kind: Kind, gate: Gate, sizes: Floats, exponent: int) -> bool:
    spec = _map.KINDS[kind]
    if float(sizes.max()) > 2**15 - 1:
        return False
    whole: Integers = sizes.astype(np.int64)
    most = _MOST[spec.of]
    if spec.shape == "pairs":
        rows = whole[RING].reshape(columns.ELECTRODES, -1).sum(axis=1) * most
        if rows.max() > _LARGEST:
            return False
        total = int(((rows >> _map.ROW_CUT) + 1).sum()) * most
    else:
        total = int(whole.sum()) * most
    if total > _LARGEST - (1 << _map.GATE_CUT):
        return False
    if gate != Gate.ONE:
        total = ((total >> _map.GATE_CUT) + 1) * _map.GATE_MAX
    return bool(total + (1 << exponent - 1) <= _LARGEST)
