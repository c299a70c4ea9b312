"""What a fast link passes on to a DeviceClock."""

from __future__ import annotations

import math

from .device_clock import DeviceClock

# During this time a drift of 500 ppm, more than any crystal has, moves the clocks against each other by 10 us.
EVERY_S = 0.02


class Arrivals:
    """Passes the quickest message of every EVERY_S to a clock.

    The clock's bound depends only on the quickest message of each second. Passing on each of thousands of chunks a
    second would cost the reading thread as much as decoding them.
    """

    def __init__(self, clock: DeviceClock) -> None:
        self._clock = clock
        self._due_s = -math.inf
        self.forget()

    def forget(self) -> None:
        """Forget what came before: the device restarted, and its time began anew."""
        self._lag_s = math.inf
        self._t_us = 0
        self._host_s = 0.0

    def note(self, t_us: int, host_s: float) -> None:
        """See DeviceClock.arrived."""
        lag_s = host_s - t_us * 1e-6
        if lag_s < self._lag_s:
            self._lag_s, self._t_us, self._host_s = lag_s, t_us, host_s
        if host_s >= self._due_s:
            self._due_s = host_s + EVERY_S
            self._lag_s = math.inf
            self._clock.arrived(self._t_us, self._host_s)
