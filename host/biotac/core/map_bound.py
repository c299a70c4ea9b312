"""How far a board's results may be off what its map means, frame by frame, from the formats of its numbers alone.

protocol/SPEC.md, Wrench maps, "What that costs". Everything here is in the board's integers' units.
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
_CONDUCTANCE_OFF = 0.52  # of its size, besides half a unit


def bound_of(its: BoardMap, wanted: Unrounded | None, signals: Signals) -> Floats:
    """(n, axes) in the results' units, from ``wanted``, or without it from what the integers mean."""
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


# Whose columns other kinds are made of, or are themselves.
_LINES = (Kind.OFFSET, Kind.SIGNAL, Kind.COMPRESSION, Kind.BULGE, Kind.CONDUCTANCE, Kind.PRESSURE)


def _factor_off(kind: Kind, factor: Floats) -> Floats:
    """Of each factor (n, columns): half a unit, and a conductance's reciprocal."""
    if kind == Kind.OFFSET:
        return np.zeros_like(factor)
    share = _CONDUCTANCE_OFF / FACTOR["conductance"] if kind == Kind.CONDUCTANCE else 0.0
    result: Floats = 0.5 + share * np.abs(factor)
    return result


def _line(block: BoardBlock, exact: Floats, factors: dict[Kind, Floats]) -> tuple[Floats, Floats]:
    """A block's sum (n, axes), and by how much it may be off."""
    factor = factors[block.kind]
    size, rounding = np.abs(block.coefficients), np.abs(exact - block.coefficients)
    return factor @ exact, np.abs(factor) @ rounding + _factor_off(block.kind, factor) @ size


def _pairs(block: BoardBlock, exact: Floats, factors: dict[Kind, Floats]) -> tuple[Floats, Floats]:
    """The same row by row of the ring, of each of whose products less than a unit is cut."""
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
    """(19, 19) of coefficients (190,): a row of the ring in each row."""
    square = np.zeros((ELECTRODES, ELECTRODES))
    square[_FIRST, (_FIRST + _BEHIND) % ELECTRODES] = pairs[RING]
    return square


def _gates_off(signals: Signals, value: dict[Gate, Floats]) -> dict[Gate, Floats]:
    """Of each gate (n, 1): weights and places to half a unit, and the quotient."""
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
