"""Device times on another clock of this computer (LSL's, ROS's), for programs that pass a stream on."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Hashable
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from .device_clock import DeviceClock

RENEW_S = 0.5  # between questions for the board's time
UNKNOWN_S = 0.05  # the same, while the board's time is unknown
STEP_S = 1e-6  # between stamps; less would be lost in a float64 of Unix time


class TimedBoard(Protocol):
    """A board that can be asked for its time, such as a Hand."""

    clock: DeviceClock

    @property
    def ended(self) -> bool:
        """Whether there is nothing more to stamp."""

    def sync(self, round_trips: int = 5) -> None:
        """Feed ``clock`` with round trips. Raises DeviceLostError."""


class Stamps:
    """Time stamps for the stream of ``board``, in seconds of the clock that ``now_s`` reads.

    They come from ``board.clock``, which ``keep`` feeds. While that knows nothing, as with a simulated board without a
    real clock, rows that came together are stamped by their arrival; ``by_arrival`` counts these. The
    stamps of one ``stream`` always grow, by STEP_S at least, unless the clock itself steps back: an estimate that is
    not later than the stamp before it is raised.
    """

    def __init__(self, board: TimedBoard, now_s: Callable[[], float]) -> None:
        self._board = board
        self._now_s = now_s
        self._latest_now_s = -math.inf
        self._last_s: dict[Hashable, float] = {}  # by stream
        self.by_arrival = 0
        board.sync()
        self._asked_s = time.monotonic()

    def keep(self) -> None:
        """Call this with every batch: it asks for the time of the board when that is due. Raises DeviceLostError."""
        wait_s = RENEW_S if self._board.clock.now().known else UNKNOWN_S
        if not self._board.ended and time.monotonic() - self._asked_s > wait_s:
            self._board.sync(1)
            self._asked_s = time.monotonic()

    def of(self, t_us: NDArray[np.float64], stream: Hashable = None) -> NDArray[np.float64]:
        """Stamps (n,) in s for unwrapped device times (n,) in us that came together; the last is the newest."""
        if not len(t_us):
            return np.empty(0)
        steps_s, estimated_s = STEP_S * np.arange(len(t_us)), self._estimated(t_us)
        least_s = self._last_s.get(stream, -math.inf) + STEP_S
        stamps_s: NDArray[np.float64] = np.maximum(estimated_s - steps_s, least_s)
        stamps_s = np.maximum.accumulate(stamps_s) + steps_s
        self._last_s[stream] = float(stamps_s[-1])
        return stamps_s

    def _estimated(self, t_us: NDArray[np.float64]) -> NDArray[np.float64]:
        # The two clocks may step against each other at any time, so the offset is measured anew.
        before_s = time.monotonic()
        now_s = self._now_s()
        if now_s < self._latest_now_s:
            self._last_s.clear()  # the clock was set back
        self._latest_now_s = now_s
        offset_s = now_s - (before_s + time.monotonic()) / 2
        stamps_s: NDArray[np.float64] = self._board.clock.host_time_s(t_us) + offset_s
        if np.isfinite(stamps_s).all():
            return stamps_s
        self.by_arrival += len(t_us)
        by_arrival: NDArray[np.float64] = now_s + (t_us - t_us[-1]) / 1e6
        return by_arrival
