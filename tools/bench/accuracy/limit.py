"""The effect of one step of the sensor's own ADC on the results: the limit that no kernel can beat.

The simulated finger (biotac.sim.physics) is pressed with 1 N by a flat of 2 mm at places all over it, without noise.
Its counts, exact and rounded to whole ones, go through the formulas in float64; the distance between the two results
is the effect of the converter's rounding. The resting counts stay exact, because a tare is an average of many frames.
A kernel's own error on those frames should stay below a twentieth of that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from biotac.core import geometry as surface
from biotac.core.compiled import default_settings, formula_settings
from biotac.sim import physics
from biotac.wire.messages_gen import PocWeights, Setting
from biotac.wire.native import ffi, lib

FORCE_N = 1.0
TIP_RADIUS_MM = 2.0
FINGERS = 8  # each with other resistances, so that the result does not depend on one finger's rounding
BUDGET_SHARE = 1 / 20

#: What is compared, in the order of BT_KERNEL_ERRORS, and its unit. N*um is the wire's mN*mm.
QUANTITIES: dict[str, str] = {
    "PoC": "um",
    "force": "mN",
    "torque y, z": "N*um",
    "torque x": "N*um",
}

Floats = NDArray[np.float64]


def places_mm() -> Floats:
    """Contacts (n, 3) over the ventral surface, about every millimetre and every ten degrees."""
    along, across = np.meshgrid(np.linspace(-14.0, 4.0, 13), np.linspace(-0.85, 0.85, 13))
    reach = np.sqrt(surface.RADIUS_MM**2 - np.maximum(along, 0.0) ** 2)
    return surface.on_surface(np.column_stack([along.ravel(), (across * reach).ravel()]))


def rms(errors: Floats) -> float:
    """RMS of errors of any shape; 0 if there are none."""
    return float(np.sqrt((errors**2).mean())) if errors.size else 0.0


def one_step(weights: PocWeights) -> dict[str, float]:
    """RMS change over all places by quantity, with one kind of PoC weights and the default gains.

    For the point it is the distance, for the others the axis that changes most.
    """
    settings = formula_settings(default_settings() | {Setting.POC_WEIGHTS: int(weights)})
    changes = [_results(np.rint(c) - rest, settings) - _results(c - rest, settings) for c, rest in _presses()]
    change = np.concatenate(changes) * 1e3  # mm, N and N*mm to um, mN and mN*mm
    furthest = [np.abs(columns).max(axis=1) for columns in (change[:, 3:6], change[:, 7:], change[:, 6:7])]
    sizes = (np.linalg.norm(change[:, :3], axis=1), *furthest)
    return {quantity: rms(its) for quantity, its in zip(QUANTITIES, sizes, strict=True)}


def frames_q4() -> NDArray[np.int32]:
    """The same presses as a board sees them: whole counts minus a tare in 1/16 count, (n, 19)."""
    signals = [np.rint(16.0 * (np.rint(c) - rest)).astype(np.int32) for c, rest in _presses()]
    return np.ascontiguousarray(np.concatenate(signals))


def _presses() -> list[tuple[Floats, Floats]]:
    """For each finger, counts (n, 19) under 1 N at each place, and at rest; neither rounded."""
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
