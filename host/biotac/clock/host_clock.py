"""This computer's clock, which reading and waiting use; tests pass their own, so that they need not wait."""

from __future__ import annotations

import threading
import time


class HostClock:
    """Time on this side of the link."""

    def __init__(self) -> None:
        self._awake = threading.Event()

    monotonic_s = staticmethod(time.monotonic)  # not a method: it is called thousands of times a second

    def sleep(self, seconds: float) -> None:
        """Let time pass, until ``wake`` at most."""
        self._awake.wait(seconds)

    def wake(self) -> None:
        """End all sleeps, current and future ones."""
        self._awake.set()
