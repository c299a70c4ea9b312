"""Looking again until something is there: for what no operating system tells alike."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TypeVar

Found = TypeVar("Found")
EVERY_S = 0.2


def wait_for(look: Callable[[], Found | None], seconds: float) -> Found | None:
    """What ``look`` found within so many seconds; it looks once at least."""
    end = time.monotonic() + seconds
    while True:
        found = look()
        if found is not None or time.monotonic() >= end:
            return found
        time.sleep(EVERY_S)
