"""A bound on the error of a board's results against its exact map, for each frame, from the number formats alone.

See protocol/SPEC.md, Wrench maps, "What that costs". Everything here is in the units of the board's integers.
"""

from __future__ import annotations

import numpy as np

from ..wire import map_gen as _map
from ..wire.map_gen import Gate, Kind
from . import geometry as surface
from .board_map import RING, BoardBlock, BoardMap
from .geometry import Floats
from .map_columns import ELECTRODES, REACH_MM, Signals, centroid_mm, gates, kinds
from .map_float64 import Unrounded
from .map_quantise import FACTOR, unit

_FIRST, _BEHIND = np.indices((ELECTRODES, len(RING) // ELECTRODES)).reshape(2, -1)
_CONDUCTANCE_OFF = 0.52  # relative error in 1 / FACTOR["conductance"], in addition to half a unit


def bound_of(its: BoardMap, wanted: Unrounded | None, signals: Signals) -> Floats:
    """The bound (n, axes) in the results' units, against the coefficients ``wanted``, or None: the integers' own."""
    columns, gate_values = kinds(signals), gates(signals.e)
    factors = {kind: columns[kind] * FACTOR[_map.KINDS[kind].of] for kind in _LINES if kind in columns}
    gate_off = _gates_off(signals, gate_values)
    total = np.zeros((len(signals.e), its.axes))
    for block in its.blocks:
        scale = 2.0 ** np.array(block.exponent)
        exact = block.coefficients.astype(np.float64)
        if wanted is not None:
            exact = wanted[block.kind, block.gate] / unit(block.kind, block.gate) * scale
        value, off = (_pairs if _map.KINDS[block.kind].shape == "pairs" else _line)(block, exact, factors)
        if block.gate != Gate.ONE:
            cut, gate = 2.0**_map.GATE_CUT, np.abs(gate_values[block.gate]) * 2.0**_map.GATE_Q
            off = off / cut + 0.5
            off = gate * off + gate_off[block.gate] * (np.abs(value) / cut + off)
        total += off / scale + 0.5
    return total


# The kinds whose own columns are factors; pairs are products of them.
_LINES = (Kind.OFFSET, Kind.SIGNAL, Kind.COMPRESSION, Kind.BULGE, Kind.CONDUCTANCE, Kind.PRESSURE)


def _factor_off(kind: Kind, factor: Floats) -> Floats:
    """The error of each factor (n, columns): half a unit, and for a conductance that of its reciprocal."""
    if kind == Kind.OFFSET:
        return np.zeros_like(factor)
    share = _CONDUCTANCE_OFF / FACTOR["conductance"] if kind == Kind.CONDUCTANCE else 0.0
    result: Floats = 0.5 + share * np.abs(factor)
    return result


def _line(block: BoardBlock, exact: Floats, factors: dict[Kind, Floats]) -> tuple[Floats, Floats]:
    """A block's sum (n, axes), and the bound on its error."""
    factor = factors[block.kind]
    size, rounding = np.abs(block.coefficients), np.abs(exact - block.coefficients)
    return factor @ exact, np.abs(factor) @ rounding + _factor_off(block.kind, factor) @ size


def _pairs(block: BoardBlock, exact: Floats, factors: dict[Kind, Floats]) -> tuple[Floats, Floats]:
    """Like _line, row by row of the ring; each of its products loses less than a unit to a shift."""
    kind = Kind.SIGNAL if block.kind == Kind.SIGNAL_PAIRS else Kind.CONDUCTANCE
    factor, cut = factors[kind], 2.0**_map.ROW_CUT
    factor_off = _factor_off(kind, factor)
    value, off = np.zeros((2, len(factor), exact.shape[1]))
    for axis in range(exact.shape[1]):
        square, size, rounding = (
            _square(of[:, axis]) for of in (exact, np.abs(block.coefficients), np.abs(exact - block.coefficients))
        )
        row = factor @ square.T
        row_off = np.abs(factor) @ rounding.T + factor_off @ size.T
        value[:, axis] = (row * factor).sum(axis=1) / cut
        off[:, axis] = ((np.abs(factor) + factor_off) * row_off + factor_off * np.abs(row)).sum(axis=1) / cut
        off[:, axis] += ELECTRODES
    return value, off


def _square(pairs: Floats) -> Floats:
    """The coefficients (190,) as (19, 19), with a row of the ring in each row."""
    square = np.zeros((ELECTRODES, ELECTRODES))
    square[_FIRST, (_FIRST + _BEHIND) % ELECTRODES] = pairs[RING]
    return square


def _gates_off(signals: Signals, value: dict[Gate, Floats]) -> dict[Gate, Floats]:
    """The error of each gate (n, 1): weights and places are off by up to half a unit, and the quotient is rounded."""
    centre = centroid_mm(signals.e)
    weight = (np.maximum(-signals.e, 0.0) + _map.FLOOR_COUNTS).sum(axis=1, keepdims=True) * 2.0**_map.SIGNAL_Q
    off = []
    for axis, reach in enumerate(REACH_MM):
        spread = np.abs(surface.ELECTRODE_MM[:, axis] - centre[:, axis, None]).sum(axis=1, keepdims=True) / reach
        place = 0.5 * 2.0 ** (_map.GATE_Q - _map.PLACE_Q)
        off.append(place + 0.5 + 0.5 * spread / (weight - 0.5 * ELECTRODES) * 2.0**_map.GATE_Q)
    x, y = off
    size = {gate: np.abs(its) for gate, its in value.items()}
    both = 2.0**-_map.GATE_Q
    return {
        Gate.X: x,
        Gate.Y: y,
        Gate.XX: 2.0 * size[Gate.X] * x + x * x * both + 0.5,
        Gate.XY: size[Gate.X] * y + size[Gate.Y] * x + x * y * both + 0.5,
        Gate.YY: 2.0 * size[Gate.Y] * y + y * y * both + 0.5,
    }
