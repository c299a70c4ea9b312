"""Counts of a finger that the population map knows: for rehearsing a calibration whose result is known.

On the sensor model alone the map of real fingers is off by newtons, and few presses cannot correct that. Here the
model's counts are changed, as little as possible, until the map needs no more than a known correction to give the
force that is applied. So a rehearsal shows that a calibration finds the correction, and not how far it would
bring a real finger.
"""

from __future__ import annotations

import numpy as np

from ..calibrate.population import load
from ..calibrate.press.few_shot import Scale
from ..core.geometry import Floats

STRENGTH = 3.0  # on the pad, the map then takes the model's press for about as strong as it is
STEPS = 6  # of Newton's method; four leave less than a millinewton


def answered(e: Floats, rest: Floats, force_n: Floats, scale: Scale) -> Floats:
    """Counts above rest (n, 19) near STRENGTH ``e`` (n, 19), for which the map needs just ``scale``.

    ``rest`` (19,) are counts at rest, ``force_n`` (n, 3) is what ``scale`` makes of the map's force, in N.
    """
    force = load(None).population.force
    z = force_n[:, 2] / scale.gain
    map_n = np.column_stack([force_n[:, 0] + scale.balance * z, force_n[:, 1], z])
    e, one = STRENGTH * e, np.eye(e.shape[1])
    for _ in range(STEPS):
        now_n = force(rest + e, rest)
        slope = np.stack([force(rest + e + step, rest) - now_n for step in one], axis=2)  # (n, 3, 19) N/count
        least = np.linalg.pinv(slope) @ (map_n - now_n)[:, :, None]
        e = e + least[:, :, 0]
    return e
