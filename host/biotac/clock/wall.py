"""The clock that waiting goes by, so that tests need not wait."""

from __future__ import annotations

import threading
import time
from typing import Protocol


class Timing(Protocol):
    """Time on this side of the link."""

    def monotonic_s(self) -> float:
        """Time since anything; never steps."""

    def unix_ns(self) -> int:
        """Time since 1970 UTC."""

    def pause(self, seconds: float) -> None:
        """Wait, between two tries to find the board again."""

    def wake(self) -> None:
        """End all pauses, present and to come."""


class RealTiming:
    """The computer's clocks."""

    def __init__(self) -> None:
        self._awake = threading.Event()

    monotonic_s = staticmethod(time.monotonic)  # asked thousands of times a second

    def unix_ns(self) -> int:
        """See Timing."""
        return time.time_ns()

    def pause(self, seconds: float) -> None:
        """See Timing."""
        self._awake.wait(seconds)

    def wake(self) -> None:
        """See Timing."""
        self._awake.set()
