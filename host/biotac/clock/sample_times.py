"""Device times of single samples, from their slots.

A round's t_us is the time of its slot 0; slot k is k/4400 s later. Times are float64 us, as slots do not begin at
whole us.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..wire import sensor_gen as sensor
from ..wire.slots import ELECTRODE_SLOT, PAC_SLOT, SLOTS_PER_FRAME

SLOT_US = 1e6 / sensor.SLOT_HZ
#: From a round's t_us to the last sample: no message of the round can have been sent before.
LAST_SAMPLE_US = int((SLOTS_PER_FRAME - 1) * SLOT_US)


def channel_t_us(t_us: ArrayLike, channel: str) -> NDArray[np.float64]:
    """Times (n, m) of a channel's m samples in the rounds that began at ``t_us`` (n,).

    ``channel`` is E1..E19, PAC, PDC, TAC or TDC; any other raises ValueError. For PAC, t_us is that of the round's
    FRAME; PAC messages have a t_us of their own, see pac_t_us.
    """
    slots = [k for k, name in enumerate(sensor.SLOTS) if name == channel]
    if not slots:
        raise ValueError(f"channel is {channel!r}, expected one of {', '.join(sorted(set(sensor.SLOTS)))}")
    return _add(t_us, np.array(slots) * SLOT_US)


def electrode_t_us(t_us: ArrayLike) -> NDArray[np.float64]:
    """Times (n, 19) of the samples of electrodes E1..E19 in frames with ``t_us`` (n,)."""
    return _add(t_us, ELECTRODE_SLOT * SLOT_US)


def pac_t_us(t_us: ArrayLike) -> NDArray[np.float64]:
    """Times (n, 22) of the samples of PAC messages with ``t_us`` (n,): every other slot, 2200 a second."""
    return _add(t_us, (PAC_SLOT - PAC_SLOT[0]) * SLOT_US)


def _add(t_us: ArrayLike, later_us: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(t_us, np.float64)[..., None] + later_us
