"""What the models are linear in: one row of features a frame, of which each model uses a range.

Features are functions of the tared counts alone (and of PDC where there is one), so they can be
computed at any drift. Columns are scaled to be of the order of one; none is centred or standardised
by the run itself, because a fitted map has to mean the same on the next run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .. import _sensor
from ..sim import surface
from .recorded import Floats

ELECTRODES = len(_sensor.ELECTRODE_NAMES)
SIGNAL_COUNTS = 500.0  # a firm press; only sets the columns' size
PRESSURE_COUNTS = 100.0
GATE_FLOOR_COUNTS = 5.0  # per electrode: noise must not throw the centroid about when nothing is compressed
GATE_MM = (8.0, 4.0)  # half the pad along and across
MIN_COUNT, MAX_COUNT = 1.0, 4090.0  # numerics.md 1.3: 0 is taken for 10 MOhm

_UPPER = np.triu_indices(ELECTRODES)
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
    """All features (n, 532), or (n, 535) with PDC: what QUADRATIC, CONDUCTANCE_QUADRATIC and GATED name."""
    e = signals.e / SIGNAL_COUNTS
    count = np.clip(signals.e + signals.tare, MIN_COUNT, MAX_COUNT)
    at_rest = np.clip(signals.tare, MIN_COUNT, MAX_COUNT)
    conductance = _conductance(count) / _conductance(at_rest) - 1.0
    # compression and bulge are different physics (biotac.md finding 4)
    split = np.concatenate([np.minimum(e, 0.0), np.maximum(e, 0.0)], axis=1)
    centre = centroid_mm(signals.e)
    along, across = centre[:, :1] / GATE_MM[0], centre[:, 1:2] / GATE_MM[1]
    blocks = [e, _products(e), conductance, _products(conductance), split, split * along, split * across]
    if signals.pdc is not None:
        pressure = signals.pdc[:, None] / PRESSURE_COUNTS
        blocks += [pressure, pressure * along, pressure * across]
    return np.concatenate(blocks, axis=1)


def centroid_mm(e: Floats) -> Floats:
    """Centroid (n, 3) of the compressed electrodes in mm; the middle of all when none is compressed."""
    weights = np.maximum(-e, 0.0) + GATE_FLOOR_COUNTS
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
    # d ln(c / (4095 - c)) / dc, turned over
    return np.clip(tare, MIN_COUNT, MAX_COUNT) * (1.0 - np.clip(tare, MIN_COUNT, MAX_COUNT) / _sensor.FULL_SCALE_COUNT)


LINEAR = Family(slice(0, ELECTRODES), 1, _counts_scale)
QUADRATIC = Family(slice(0, _QUADRATIC), 1, _counts_scale)
CONDUCTANCE_QUADRATIC = Family(slice(_QUADRATIC, 2 * _QUADRATIC), 1, _conductance_scale)
SIGN_SPLIT = Family(slice(2 * _QUADRATIC, 2 * _QUADRATIC + 2 * ELECTRODES), 2, _counts_scale)
GATED = Family(slice(2 * _QUADRATIC, None), 2, _counts_scale)
