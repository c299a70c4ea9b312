"""What one step of the sensor's own ADC does to the results: the limit that no kernel can beat.

The simulated finger (biotac.sim.physics) is pressed with 1 N by a flat of 2 mm at places all over it, without
noise. Its counts, exact and rounded to whole ones, go through the formulas in float64; the distance between
the two results is what rounding in the converter does. The resting counts stay exact: a tare is an average
of many frames. A kernel's own error on those frames is asked to stay below a twentieth of that.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from biotac.core import geometry as surface
from biotac.core.compiled import default_settings, formula_settings
from biotac.sim import physics
from biotac.wire.messages_gen import PocWeights, Setting
from biotac.wire.native import ffi, lib

FORCE_N = 1.0
TIP_RADIUS_MM = 2.0
FINGERS = 8  # with other resistances each, or one finger's roundings would decide
BUDGET_SHARE = 1 / 20

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Limit:
    """RMS change over all places, um, mN, mN*mm (N*um): of the point, and of the axis that changes most."""

    poc_um: float
    force_mn: float
    torque_yz_mnmm: float
    torque_x_mnmm: float

    def values(self) -> tuple[float, float, float, float]:
        """In the order of measure.QUANTITIES."""
        return self.poc_um, self.force_mn, self.torque_yz_mnmm, self.torque_x_mnmm


def places_mm() -> Floats:
    """Contacts (n, 3) over the ventral surface, every millimetre and ten degrees or so."""
    along, across = np.meshgrid(np.linspace(-14.0, 4.0, 13), np.linspace(-0.85, 0.85, 13))
    reach = np.sqrt(surface.RADIUS_MM**2 - np.maximum(along, 0.0) ** 2)
    return surface.on_surface(np.column_stack([along.ravel(), (across * reach).ravel()]))


def one_step(weights: PocWeights) -> Limit:
    """The limit for one kind of PoC weights and the default gains."""
    settings = formula_settings(default_settings() | {Setting.POC_WEIGHTS: int(weights)})
    changes = [_results(np.rint(c) - rest, settings) - _results(c - rest, settings) for c, rest in _presses()]
    change = np.concatenate(changes) * 1e3  # mm, N and N*mm to um, mN and mN*mm

    def rms(sizes: Floats) -> float:
        return float(np.sqrt((sizes**2).mean()))

    def furthest(columns: Floats) -> float:
        return rms(np.abs(columns).max(axis=1))

    point = rms(np.linalg.norm(change[:, :3], axis=1))
    return Limit(point, furthest(change[:, 3:6]), furthest(change[:, 7:]), furthest(change[:, 6:7]))


def frames_q4() -> NDArray[np.int32]:
    """The same presses as a board gets them: whole counts less a tare in 1/16 count, (n, 19)."""
    signals = [np.rint(16.0 * (np.rint(c) - rest)).astype(np.int32) for c, rest in _presses()]
    return np.ascontiguousarray(np.concatenate(signals))


def _presses() -> list[tuple[Floats, Floats]]:
    """Per finger, counts (n, 19) under 1 N at every place, and at rest; neither rounded."""
    contact = places_mm()
    n = len(contact)
    zeros = np.zeros(n)
    tip = np.full(n, TIP_RADIUS_MM)
    states = physics.States(contact, np.full(n, FORCE_N), np.zeros((n, 3)), zeros, tip, zeros)
    fingers = [physics.Finger(seed) for seed in range(FINGERS)]
    return [(finger.counts(states), finger.rest_counts(zeros)) for finger in fingers]


def _results(e: Floats, settings: object) -> Floats:
    """(n, 9): poc_mm, force_n, torque_nmm."""
    out = np.empty((len(e), 9))
    result = ffi.new("lin2013_result *")
    rows = np.ascontiguousarray(e)
    for k, row in enumerate(rows):
        lib.lin2013(ffi.from_buffer("double[]", row), settings, result)
        out[k] = [*result.poc_mm, *result.force_n, *result.torque_nmm]
    return out
