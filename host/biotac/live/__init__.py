"""Reading a board in the background: threads, queues, callbacks, latest values, and coming back after a lost link."""

from __future__ import annotations

from .fingers import DEFAULT_NAMES, FingerView
from .gap import Gap

__all__ = ["DEFAULT_NAMES", "FingerView", "Gap"]
