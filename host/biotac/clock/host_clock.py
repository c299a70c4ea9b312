"""This computer's clock, which reading and waiting go by; tests pass one of their own, so that they need not wait."""

from __future__ import annotations

import threading
import time
from typing import Protocol


class HostClock(Protocol):
    """Time on this side of the link."""

    def monotonic_s(self) -> float:
        """Time since anything; never steps."""

    def unix_ns(self) -> int:
        """Time since 1970 UTC."""

    def sleep(self, seconds: float) -> None:
        """Let time pass."""

    def wake(self) -> None:
        """End all sleeps, present and to come."""


class SystemClock:
    """The operating system's."""

    def __init__(self) -> None:
        self._awake = threading.Event()

    monotonic_s = staticmethod(time.monotonic)  # asked thousands of times a second
    unix_ns = staticmethod(time.time_ns)

    def sleep(self, seconds: float) -> None:
        """See HostClock."""
        self._awake.wait(seconds)

    def wake(self) -> None:
        """See HostClock."""
        self._awake.set()
