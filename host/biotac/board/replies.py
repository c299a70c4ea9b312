"""A board's answers to the thread that asks."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ..wire import messages_gen as wire


class Replies:
    """Messages that arrive while somebody awaits a reply. One command at a time; another thread reads the link."""

    def __init__(self) -> None:
        self.awaited = False
        self._came: deque[tuple[Any, float]] = deque()  # messages, and when
        self._quiet_id = 0

    @contextmanager
    def awaiting(self, req_id: int, *, quiet: bool) -> Iterator[None]:
        """Collect arriving messages; nobody else sees the answer to a ``quiet`` question."""
        self._came.clear()
        self._quiet_id, self.awaited = req_id if quiet else 0, True
        try:
            yield
        finally:
            self._quiet_id, self.awaited = 0, False

    def for_all(self, messages: list[Any]) -> list[Any]:
        """Those that everybody sees."""
        quiet_id = self._quiet_id
        return [m for m in messages if getattr(m, "req_id", 0) != quiet_id] if quiet_id else messages

    def put(self, messages: list[Any], arrived_s: float) -> None:
        """Collect arriving messages, on the reading thread."""
        self._came.extend((message, arrived_s) for message in messages)

    def find(self, request: Any, reply: type[Any]) -> tuple[Any, float] | None:
        """The reply to ``request``, or the refusal, and when it arrived; None while it has not come."""
        while self._came:
            message, arrived_s = self._came.popleft()
            # A board that does not know a command's length cannot read the req_id, and refuses it without.
            unread = isinstance(message, wire.Reply) and (message.req_id, message.command) == (0, request.ID)
            if unread or (isinstance(message, (reply, wire.Reply)) and message.req_id == request.req_id):
                return message, arrived_s
        return None
