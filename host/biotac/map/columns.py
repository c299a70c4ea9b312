"""The columns in which a wrench map is linear (protocol/map.toml): kinds of columns, and the gates that weight them.

They are functions of one frame's tared counts (and of PDC if there is any) alone, so a frame can be checked by itself
and at any drift. Columns are scaled to be of the order of one. None is centred or standardised by a run's own data,
because a fitted map has to mean the same on the next run.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..kernels import geometry as surface
from ..kernels.geometry import Floats
from ..wire import map_gen as _map
from ..wire import messages_gen as wire
from ..wire import sensor_gen as _sensor
from ..wire.frames import Q4_PER_COUNT
from ..wire.map_gen import Gate, Kind

ELECTRODES = len(_sensor.ELECTRODE_NAMES)
SIGNAL_COUNTS = 500.0  # a firm press; only sets the columns' size
PRESSURE_COUNTS = 100.0
#: The axes that a map can have, in the blob's order; N for forces, N mm for the others.
AXES = ("Fx", "Fy", "Fz", "Mx", "My", "Mz", "torsion")
REACH_MM = (_map.REACH_X_UM / 1000, _map.REACH_Y_UM / 1000)

_UPPER = np.triu_indices(ELECTRODES)


@dataclass(frozen=True)
class Signals:
    """One row a frame: ``e`` (n, 19) counts above ``tare`` (19,), ``pdc`` (n,) counts above rest or None."""

    e: Floats
    tare: Floats
    pdc: Floats | None = None

    def drifted(self, counts: Floats) -> Signals:
        """The signals as if every row had drifted by ``counts`` (19,)."""
        return Signals(self.e + counts, self.tare, self.pdc)


def tared(counts: npt.NDArray[np.uint16], tare_q4: npt.NDArray[np.uint16]) -> Signals:
    """Signals (n, 19) from the integers (n, 19) of FRAMEs; 0 where the count or the tare is missing."""
    missing = (counts == wire.INVALID_COUNT) | (tare_q4 == wire.INVALID_COUNT)
    tare = np.where(missing, 0.0, tare_q4 / Q4_PER_COUNT)
    return Signals(np.where(missing, 0.0, counts - tare), tare)


def summed(blocks: Iterable[tuple[Block, Floats]], signals: Signals) -> Floats:
    """The sum of blocks (n, axes), each with coefficients (columns, axes)."""
    found, gate = kinds(signals), gates(signals.e)
    total: Floats = np.zeros(())
    for (kind, which), coefficients in blocks:
        total = total + found[kind] @ coefficients * gate[which]
    return total


# ---- the columns of a fitted map, block by block ------------------------------------------------

Block = tuple[Kind, Gate]
STRAIGHT = (Gate.ONE, Gate.X, Gate.Y)
SPLIT = (Kind.COMPRESSION, Kind.BULGE)  # different physics: a squeezed path and one that is wider than at rest
GATED: tuple[Block, ...] = tuple((kind, gate) for gate in STRAIGHT for kind in SPLIT)  # all that a population map has
PRESSURES: tuple[Block, ...] = tuple((Kind.PRESSURE, gate) for gate in STRAIGHT)
#: Each block's kind and gate. PRESSURE is last: without PDC there are just the columns before it.
BLOCKS: tuple[Block, ...] = (
    (Kind.SIGNAL, Gate.ONE),
    (Kind.SIGNAL_PAIRS, Gate.ONE),
    (Kind.CONDUCTANCE, Gate.ONE),
    (Kind.CONDUCTANCE_PAIRS, Gate.ONE),
    *GATED,
    *PRESSURES,
)


def blocks(*, with_pdc: bool) -> tuple[Block, ...]:
    """The blocks of all columns, in order."""
    return BLOCKS if with_pdc else BLOCKS[: -len(PRESSURES)]


def width(chosen: Iterable[Block]) -> int:
    """Number of columns of the ``chosen`` blocks."""
    return sum(_map.KINDS[kind].columns for kind, _ in chosen)


def index(chosen: Sequence[Block], count: int) -> npt.NDArray[np.intp]:
    """Indices of the ``chosen`` blocks' columns among the first ``count`` of BLOCKS: 532 without PDC, 535 with it."""
    own = np.repeat([block in chosen for block in BLOCKS], [width([block]) for block in BLOCKS])
    return np.flatnonzero(own[:count])


def split(named: Iterable[Block], coefficients: Floats) -> dict[Block, Floats]:
    """The coefficients of each block, from those of all of them (columns, axes)."""
    parts, at = {}, 0
    for kind, gate in named:
        parts[kind, gate] = coefficients[at : at + _map.KINDS[kind].columns]
        at += _map.KINDS[kind].columns
    return parts


def columns(signals: Signals, chosen: Iterable[Block] | None = None) -> Floats:
    """The columns (n, width) of the ``chosen`` blocks; of all that the signals have, (n, 532) or (n, 535), if None."""
    named = list(blocks(with_pdc=signals.pdc is not None) if chosen is None else chosen)
    found, gate = kinds(signals), gates(signals.e)
    result = np.empty((len(signals.e), width(named)))
    at = 0
    for kind, which in named:
        own = result[:, at : at + found[kind].shape[1]]
        if which == Gate.ONE:
            own[:] = found[kind]
        else:
            np.multiply(found[kind], gate[which], out=own)
        at += own.shape[1]
    return result


def with_one(values: Floats) -> Floats:
    """Columns (n, p) with a column of ones for the offset appended, (n, p + 1)."""
    return np.concatenate([values, np.ones((len(values), 1))], axis=1)


# ---- kinds and gates ---------------------------------------------------------------------------


def kinds(signals: Signals) -> dict[Kind, Floats]:
    """The columns (n, width) of each kind; PRESSURE only if the signals have it."""
    e = signals.e / SIGNAL_COUNTS
    count, at_rest = (np.clip(c, _map.COUNT_MIN, _map.COUNT_MAX) for c in (signals.e + signals.tare, signals.tare))
    # clipped, so that the square of a wet or shorted electrode stays bounded
    conductance = np.clip(_conductance(count) / _conductance(at_rest) - 1.0, -1.0, _map.RATIO_MAX)
    result = {
        Kind.OFFSET: np.ones((len(e), 1)),
        Kind.SIGNAL: e,
        Kind.SIGNAL_PAIRS: _products(e),
        Kind.CONDUCTANCE: conductance,  # of each electrode, divided by that at rest, minus one
        Kind.CONDUCTANCE_PAIRS: _products(conductance),
        Kind.COMPRESSION: np.minimum(e, 0.0),
        Kind.BULGE: np.maximum(e, 0.0),
    }
    if signals.pdc is not None:
        result[Kind.PRESSURE] = signals.pdc[:, None] / PRESSURE_COUNTS
    return result


def gates(e: Floats) -> dict[Gate, Floats]:
    """The values (n, 1) of each gate."""
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


def _products(factors: Floats) -> Floats:
    return factors[:, _UPPER[0]] * factors[:, _UPPER[1]]
