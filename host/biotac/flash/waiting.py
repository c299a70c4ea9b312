"""Polling until something is there, for events that each operating system reports differently."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

Found = TypeVar("Found")
EVERY_S = 0.2


def wait_for(look: Callable[[], Found | None], seconds: float) -> Found | None:
    """The first result of ``look`` other than None; None after ``seconds``. Calls ``look`` at least once."""
    end = time.monotonic() + seconds
    while True:
        found = look()
        if found is not None or time.monotonic() >= end:
            return found
        time.sleep(EVERY_S)
