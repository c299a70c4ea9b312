"""How far a board's population force may be off core.population, from the formats of its numbers alone.

firmware/core/map/population.c: coefficients of 16 bits, factors and gates of 13, sums of 32.
"""

from __future__ import annotations

import numpy as np

from ..core import geometry as surface
from ..core import population
from ..core.geometry import Floats
from ..core.map_columns import ELECTRODES, REACH_MM, SIGNAL_COUNTS, Signals, centroid_mm, gates, kinds
from ..wire import map_gen as _map
from ..wire import population_gen as _formats
from ..wire.frames import FORCE_LSB_PER_N
from ..wire.map_gen import Gate, Kind

_LSB_N = 1 / FORCE_LSB_PER_N
_COUNT_OFF = 2.0**-_formats.SIGNAL_Q / 2  # of a signal
_FACTOR_OFF = 2.0**-_formats.CONDUCTANCE_Q  # of a conductance
# of a coefficient, in N a count and in N
_SIGNAL_OFF = 0.5 * 2.0 ** (_formats.SIGNAL_Q - _formats.SIGNAL_EXPONENT) * _LSB_N
_CONDUCTANCE_OFF = 0.5 * 2.0 ** (_formats.CONDUCTANCE_Q - _formats.CONDUCTANCE_EXPONENT) * _LSB_N
# of a sum that loses bits before it is multiplied, in N
_GATED_OFF = 0.5 * 2.0 ** (_formats.GATED_SHIFT - _formats.SIGNAL_EXPONENT) * _LSB_N
_ROW_OFF = 0.5 * 2.0 ** (_formats.ROW_SHIFT - _formats.CONDUCTANCE_EXPONENT) * _LSB_N
_WEIGHT_OFF = 0.5  # count, of the gates' centroid
_CENTRE_OFF_MM = 0.5e-3
_RATIO_OFF = 0.5 * 2.0**-_formats.GATE_Q


def force_bound_n(signals: Signals, lin_bound_n: float) -> Floats:
    """(n, 3) in N, with the part that is Lin's off by ``lin_bound_n``."""
    part = (population.share(signals) / population.ALL)[:, None]
    off = _signals_off(signals) + _conductances_off(signals)
    return np.where(part > 0, part * off, 0.0) + (1 - part) * lin_bound_n + 0.5 * _LSB_N


def _signals_off(signals: Signals) -> Floats:
    columns, gate = kinds(signals), gates(signals.e)
    size = np.abs(signals.e).sum(axis=1, keepdims=True)
    its = {(kind, at): coefficients for kind, at, coefficients in population.blocks()}
    total = np.zeros((len(signals.e), 3))
    for at in (Gate.ONE, Gate.X, Gate.Y):
        pair = its[Kind.COMPRESSION, at], its[Kind.BULGE, at]
        steepest = np.maximum(*np.abs(pair)).sum(axis=0) / SIGNAL_COUNTS
        off = (size + ELECTRODES * _COUNT_OFF) * _SIGNAL_OFF + _COUNT_OFF * steepest
        if at == Gate.ONE:
            total += off + 0.5 * _LSB_N
            continue
        value = np.abs(columns[Kind.COMPRESSION] @ pair[0] + columns[Kind.BULGE] @ pair[1])
        gate_off = _gate_off(signals, 0 if at == Gate.X else 1)
        total += np.abs(gate[at]) * (off + _GATED_OFF) + gate_off * (value + off + _GATED_OFF) + 0.5 * _LSB_N
    return total


def _gate_off(signals: Signals, axis: int) -> Floats:
    centre = centroid_mm(signals.e)[:, axis, None]
    spread = np.abs(surface.ELECTRODE_MM[:, axis] - centre).sum(axis=1, keepdims=True)
    weight = (np.maximum(-signals.e, 0.0) + _map.FLOOR_COUNTS - _WEIGHT_OFF).sum(axis=1, keepdims=True)
    result: Floats = (_WEIGHT_OFF * spread / weight + _CENTRE_OFF_MM) / REACH_MM[axis] + _RATIO_OFF
    return result


def _conductances_off(signals: Signals) -> Floats:
    u = kinds(signals)[Kind.CONDUCTANCE]
    its = {kind: coefficients for kind, _, coefficients in population.blocks()}
    larger = np.abs(u) + _FACTOR_OFF
    upper = np.triu_indices(ELECTRODES)
    behind = np.cumsum(larger[:, ::-1], axis=1)[:, ::-1]  # of the row that begins at each
    total = np.full((len(u), 3), 0.5 * _LSB_N)
    for axis in range(3):
        square = np.zeros((ELECTRODES, ELECTRODES))
        square[upper] = its[Kind.CONDUCTANCE_PAIRS][:, axis]
        row = np.abs(its[Kind.CONDUCTANCE][:, axis] + u @ square.T)
        row_off = _CONDUCTANCE_OFF * (1 + behind) + _FACTOR_OFF * np.abs(square).sum(axis=1) + _ROW_OFF
        total[:, axis] += (larger * row_off + _FACTOR_OFF * row).sum(axis=1)
    return total
