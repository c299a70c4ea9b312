"""Device times on another clock of this computer (LSL's, ROS'), for those who pass a stream on."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .device_clock import DeviceClock

RENEW_S = 0.5  # between questions for the board's time
UNKNOWN_S = 0.05  # the same while it is unknown


class Board(Protocol):
    """A board that can be asked for its time, such as a Hand."""

    clock: DeviceClock

    @property
    def ended(self) -> bool:
        """There is nothing more to stamp."""

    def sync(self, round_trips: int = 5) -> None:
        """Feed ``clock`` with round trips. Raises DeviceLostError."""


class Stamps:
    """Stamps for what ``board`` streams, in seconds of the clock that ``now_s`` reads.

    By ``board.clock``, which ``keep`` feeds. Where that knows nothing, as of a simulated board, whose time is no
    clock, what is stamped together is stamped by its arrival; ``by_arrival`` counts.
    """

    def __init__(self, board: Board, now_s: Callable[[], float]) -> None:
        self._board = board
        self._now_s = now_s
        self.by_arrival = 0
        board.sync()
        self._asked_s = time.monotonic()

    def keep(self) -> None:
        """Call it with every batch: asks the board for its time when that is due. Raises DeviceLostError."""
        wait_s = RENEW_S if self._board.clock.now().known else UNKNOWN_S
        if not self._board.ended and time.monotonic() - self._asked_s > wait_s:
            self._board.sync(1)
            self._asked_s = time.monotonic()

    def of(self, t_us: NDArray[np.float64]) -> NDArray[np.float64]:
        """Stamps (n,) in s of unwrapped device times (n,) in us that came together; the last is the newest."""
        # The two clocks may be stepped against each other at any time: the offset is taken anew.
        before_s = time.monotonic()
        now_s = self._now_s()
        offset_s = now_s - (before_s + time.monotonic()) / 2
        stamps_s: NDArray[np.float64] = self._board.clock.host_time_s(t_us) + offset_s
        if np.isfinite(stamps_s).all():
            return stamps_s
        self.by_arrival += len(t_us)
        by_arrival: NDArray[np.float64] = now_s + (t_us - t_us[-1]) / 1e6
        return by_arrival
