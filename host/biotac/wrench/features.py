"""What the models are linear in: one row of features a frame, of which each model uses a range.

Features are functions of the tared counts alone (and of PDC where there is one), so they can be
computed at any drift. Columns are scaled to be of the order of one; none is centred or standardised
by the run itself, because a fitted map has to mean the same on the next run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .. import _map, _sensor
from .._map import Gate, Kind
from ..sim import surface
from .recorded import Floats

ELECTRODES = len(_sensor.ELECTRODE_NAMES)
SIGNAL_COUNTS = 500.0  # a firm press; only sets the columns' size
PRESSURE_COUNTS = 100.0
REACH_MM = (_map.REACH_X_UM / 1000, _map.REACH_Y_UM / 1000)

_UPPER = np.triu_indices(ELECTRODES)


@dataclass(frozen=True)
class Block:
    """A range of columns: those of ``kind``, each times the scalar ``gate``."""

    kind: Kind
    gate: Gate

    @property
    def width(self) -> int:
        """Columns."""
        return _map.KINDS[self.kind].columns


_PRESSURE = tuple(Block(Kind.PRESSURE, gate) for gate in (Gate.ONE, Gate.X, Gate.Y))
# PRESSURE last: a run without PDC has the columns before it
BLOCKS: tuple[Block, ...] = (
    Block(Kind.SIGNAL, Gate.ONE),
    Block(Kind.SIGNAL_PAIRS, Gate.ONE),
    Block(Kind.CONDUCTANCE, Gate.ONE),
    Block(Kind.CONDUCTANCE_PAIRS, Gate.ONE),
    # compression and bulge are different physics (biotac.md finding 4)
    *(Block(kind, gate) for gate in (Gate.ONE, Gate.X, Gate.Y) for kind in (Kind.COMPRESSION, Kind.BULGE)),
    *_PRESSURE,
)


def blocks(*, with_pdc: bool) -> tuple[Block, ...]:
    """The blocks of columns(), in their order."""
    return BLOCKS if with_pdc else BLOCKS[: -len(_PRESSURE)]


def width(*, with_pdc: bool) -> int:
    """Columns of columns()."""
    return sum(block.width for block in blocks(with_pdc=with_pdc))


_QUADRATIC = ELECTRODES + len(_UPPER[0])


@dataclass(frozen=True)
class Signals:
    """One row a frame: ``e`` (n, 19) counts above ``tare`` (19,), ``pdc`` (n,) counts above rest or None."""

    e: Floats
    tare: Floats
    pdc: Floats | None = None

    def drifted(self, counts: Floats) -> Signals:
        """As if every row had drifted by ``counts`` (19,)."""
        return Signals(self.e + counts, self.tare, self.pdc)


@dataclass(frozen=True)
class Family:
    """A range of the columns that a model uses.

    The first ``times`` * 19 of them are, to first order, e divided by ``scale(tare)`` (19,) counts; that
    is how Lin's sums are written in them, which is what ridge shrinks toward.
    """

    columns: slice
    times: int
    scale: Callable[[Floats], Floats]

    def unit(self, tare: Floats, columns: int) -> Floats:
        """(columns, 19): the family's columns @ this is e in counts, to first order."""
        matrix = np.zeros((columns, ELECTRODES))
        matrix[: self.times * ELECTRODES] = np.tile(np.diag(self.scale(tare)), (self.times, 1))
        return matrix


def columns(signals: Signals) -> Floats:
    """All features (n, 532), or (n, 535) with PDC, in the order of blocks()."""
    found, at = kinds(signals), gates(signals.e)
    parts = []
    for block in blocks(with_pdc=signals.pdc is not None):
        kind = found[block.kind]
        parts.append(kind if block.gate == Gate.ONE else kind * at[block.gate])
    return np.concatenate(parts, axis=1)


def kinds(signals: Signals) -> dict[Kind, Floats]:
    """Each kind's columns (n, width); PRESSURE only where there is one."""
    e = signals.e / SIGNAL_COUNTS
    count = np.clip(signals.e + signals.tare, _map.COUNT_MIN, _map.COUNT_MAX)
    at_rest = np.clip(signals.tare, _map.COUNT_MIN, _map.COUNT_MAX)
    # a wet or shorted electrode must not square to anything
    conductance = np.clip(_conductance(count) / _conductance(at_rest) - 1.0, -1.0, _map.RATIO_MAX)
    result = {
        Kind.OFFSET: np.ones((len(e), 1)),
        Kind.SIGNAL: e,
        Kind.SIGNAL_PAIRS: _products(e),
        Kind.CONDUCTANCE: conductance,
        Kind.CONDUCTANCE_PAIRS: _products(conductance),
        Kind.COMPRESSION: np.minimum(e, 0.0),
        Kind.BULGE: np.maximum(e, 0.0),
    }
    if signals.pdc is not None:
        result[Kind.PRESSURE] = signals.pdc[:, None] / PRESSURE_COUNTS
    return result


def gates(e: Floats) -> dict[Gate, Floats]:
    """Each gate (n, 1)."""
    centre = centroid_mm(e)
    x, y = centre[:, :1] / REACH_MM[0], centre[:, 1:2] / REACH_MM[1]
    return {Gate.ONE: np.ones_like(x), Gate.X: x, Gate.Y: y, Gate.XX: x * x, Gate.XY: x * y, Gate.YY: y * y}


def centroid_mm(e: Floats) -> Floats:
    """Centroid (n, 3) of the compressed electrodes in mm; the middle of all when none is compressed."""
    weights = np.maximum(-e, 0.0) + _map.FLOOR_COUNTS
    centre: Floats = weights @ surface.ELECTRODE_MM / weights.sum(axis=1, keepdims=True)
    return centre


def _conductance(count: Floats) -> Floats:
    return count / (_sensor.FULL_SCALE_COUNT - count)


def _products(of: Floats) -> Floats:
    products: Floats = of[:, _UPPER[0]] * of[:, _UPPER[1]]
    return products


def _counts_scale(tare: Floats) -> Floats:
    return np.full(ELECTRODES, SIGNAL_COUNTS)


def _conductance_scale(tare: Floats) -> Floats:
    at_rest = np.clip(tare, _map.COUNT_MIN, _map.COUNT_MAX)
    scale: Floats = at_rest * (1.0 - at_rest / _sensor.FULL_SCALE_COUNT)  # d ln(c / (4095 - c)) / dc, turned over
    return scale


_QUADRATIC = ELECTRODES + len(_UPPER[0])
LINEAR = Family(slice(0, ELECTRODES), 1, _counts_scale)
QUADRATIC = Family(slice(0, _QUADRATIC), 1, _counts_scale)
CONDUCTANCE_QUADRATIC = Family(slice(_QUADRATIC, 2 * _QUADRATIC), 1, _conductance_scale)
SIGN_SPLIT = Family(slice(2 * _QUADRATIC, 2 * _QUADRATIC + 2 * ELECTRODES), 2, _counts_scale)
GATED = Family(slice(2 * _QUADRATIC, None), 2, _counts_scale)
