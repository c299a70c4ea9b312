"""Device time on the recording computer's clock, corrected by the drift that the recording shows."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from ..clock import LAST_SAMPLE_US, DeviceClock
from ..clock.segment import MAX_DRIFT

# In less time, the delays of single messages exceed the drift of a crystal: 0.5 ms at 50 ppm.
_LEAST_S = 10.0
# A block this much too early or late did not keep pace: from a simulated board without a real clock, or after a stall.
_PACE_S = 0.5
_SETTLED_US = 600e6  # of the clock's course at a time, before it forgets older blocks
_REACH_US = 200e6


def unwrapped_us(begin_us: int, stamps_us: npt.ArrayLike) -> NDArray[np.int64]:
    """Device times of messages in order, 32 bits as sent, unwrapped from ``begin_us`` on.

    STATUS comes every second, so neighbours are never half a wrap apart.
    """
    return np.unwrap(np.append(begin_us, stamps_us).astype(np.int64), period=2**32)[1:].astype(np.int64)


class UnixTime:
    """Converts unwrapped device times to Unix ns: ``begin_ns`` at ``begin_us``, and from there as the two clocks ran.

    While the arrivals do not yet show a steady drift, plain differences of device times are used instead: in the first
    ten seconds, for a board that does not keep pace with the host, and once one of the clocks has stepped.
    """

    def __init__(self, begin_us: int, begin_ns: int) -> None:
        self._begin_us = begin_us
        self._begin_ns = begin_ns
        self._clock = DeviceClock(promised_delay_s=0.01)
        self._settled_us = float(begin_us)
        self._first: tuple[int, float] | None = None
        self._keeps_pace = False
        self._begin_s = math.nan  # by the clock; set once, so that later estimates do not shift all stamps

    def arrived(self, t_us: int, at_ns: int) -> None:
        """Note that a block had arrived completely at ``at_ns``; ``t_us`` is of the last row."""
        at_s = (at_ns - self._begin_ns) / 1e9
        self._first = self._first or (t_us, at_s)
        device_s, host_s = (t_us - self._first[0]) / 1e6, at_s - self._first[1]
        self._keeps_pace = device_s >= _LEAST_S and abs(host_s - device_s) <= _PACE_S + device_s * MAX_DRIFT
        self._clock.arrived(t_us + LAST_SAMPLE_US, at_s)
        if t_us - self._settled_us > _SETTLED_US:
            self._clock.host_time_s(np.array([self._settled_us - _REACH_US, t_us]))
            self._settled_us = t_us

    def __call__(self, t_us: NDArray[np.int64]) -> NDArray[np.int64]:
        """Unix times (n,) in ns for device times (n,) in us."""
        plain: NDArray[np.int64] = self._begin_ns + (t_us - self._begin_us) * 1000
        if not self._keeps_pace or self._clock.resets or not len(t_us):
            return plain
        if math.isnan(self._begin_s):
            self._begin_s = float(self._clock.host_time_s(self._begin_us))
        since_s = self._clock.host_time_s(t_us) - self._begin_s
        if not np.isfinite(since_s).all():  # too few blocks, hours apart
            return plain
        return self._begin_ns + np.round(since_s * 1e9).astype(np.int64)
