"""Point of application of force (PAF) from the three strongest electrodes: Wettels and Loeb 2011, Eq 4 and 5.

As printed, Eq 4 gives 3.08 N for an electrode that nothing touches, so a threshold of 1 N rejects nothing, and an
electrode at rest weighs as much as one that is pressed with 3 N. The default here subtracts that
offset, so that an electrode at rest weighs nothing. Real presses reach Eq 4's pole at V - V0 = -1.976 V; near it the
force saturates (EQ4_MAX_N).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from biotac.kernels.geometry import Floats
from biotac.wire import sensor as _sensor

from .signals import ELECTRODE_DR_MM, signals

VOLT_PER_COUNT = 3.3 / _sensor.FULL_SCALE_COUNT
EQ4_N_V, EQ4_V = 6.083, 1.976  # the paper: R^2 0.9615 for a 1 mm probe on one electrode
EQ4_REST_N = EQ4_N_V / EQ4_V
EQ4_MAX_N = 40.0  # the largest force in the paper
STRONGEST = 3
THRESHOLD_N = 1.0  # the paper: "> 1 N"

#: ``dr_mm`` is (d, r) on the skin laid flat, NaN unless ``valid``; ``force_n`` is Eq 4's sum over the three strongest.
PAF_DTYPE = np.dtype([("dr_mm", "<f8", (2,)), ("force_n", "<f8"), ("valid", "?")])


def electrode_force(rows: npt.NDArray[Any], *, as_printed: bool = False) -> Floats:
    """Force by Eq 4 for each electrode (n, 19) in N; NaN where the electrode is missing.

    ``rows`` as in signals(). ``as_printed`` keeps the 3.08 N at rest; otherwise it is subtracted and a bulge is 0 N.
    """
    volt = signals(rows) * VOLT_PER_COUNT
    floor = EQ4_N_V / EQ4_MAX_N  # least denominator: beyond the pole Eq 4 would be negative
    force: Floats = EQ4_N_V / np.maximum(volt + EQ4_V, floor)
    return force if as_printed else np.maximum(force - EQ4_REST_N, 0.0)


def paf(rows: npt.NDArray[Any], *, as_printed: bool = False, threshold_n: float = THRESHOLD_N) -> npt.NDArray[np.void]:
    """Where the force is applied: PAF_DTYPE (n,).

    ``dr_mm`` is Eq 5 in the (d, r) of signals.skin(): the mean of the three strongest electrodes' places, weighted by
    their forces from Eq 4. ``force_n`` is the sum of these forces: good for ranking, not a measurement. Where it is
    below ``threshold_n`` or not above 0, or an electrode is missing, ``dr_mm`` is NaN and ``valid`` False. A threshold
    of 0 accepts any force.
    """
    force = electrode_force(rows, as_printed=as_printed)
    best = np.argpartition(-force, STRONGEST, axis=1)[:, :STRONGEST]
    weight = np.take_along_axis(force, best, axis=1)
    result = np.zeros(len(force), PAF_DTYPE)
    total = weight.sum(axis=1)
    result["force_n"] = np.where(np.isnan(force).any(axis=1), np.nan, total)
    result["valid"] = valid = (result["force_n"] > 0.0) & (result["force_n"] >= threshold_n)
    weighted_dr_mm = (ELECTRODE_DR_MM[best] * weight[:, :, None]).sum(axis=1)
    result["dr_mm"] = np.where(valid[:, None], weighted_dr_mm / np.where(valid, total, 1.0)[:, None], np.nan)
    return result
