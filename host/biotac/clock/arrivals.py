"""What a fast link tells a DeviceClock."""

from __future__ import annotations

import math

from .device_clock import DeviceClock

# A drift of 500 ppm, beyond any crystal, moves the clocks against each other by 10 us meanwhile.
EVERY_S = 0.02


class Arrivals:
    """Hands the quickest message of every EVERY_S to a clock.

    Its bound is made by the quickest of a second: to look at each of thousands of chunks a second would cost the
    reading thread as much as decoding them.
    """

    def __init__(self, clock: DeviceClock) -> None:
        self._clock = clock
        self._due_s = -math.inf
        self.forget()

    def forget(self) -> None:
        """The device started again: what came before is not of its new time."""
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
