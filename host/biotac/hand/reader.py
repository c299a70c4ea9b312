"""The threads that read a link, so that no caller has to and the board's ring buffer does not fill.

Callbacks run on the reading thread, for the least delay. A slow callback would keep the link waiting, so a second
thread, the relief, reads until the callback is done. With a board whose time waits for its reader (Link.pace 0) it is
the other way round: reading waits for slow consumers, and nothing is dropped.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import Protocol

from .board import POLL_S
from .callbacks import Callbacks

# A callback that runs for two of these is relieved. The Pico's ring holds 40 ms of five fingers' frames; what comes
# until then has to fit in the computer's own buffers.
RELIEF_S = 0.04
# At the end, what waits is passed to callbacks for this long; the rest is skipped.
BACKLOG_S = 1.0


class Source(Protocol):
    """What a Reader reads."""

    def read(self, at_most_s: float) -> None:
        """Wait for bytes and deliver what they complete."""

    def may_relieve(self) -> bool:
        """Whether reading may go on while a callback is slow."""

    def fail(self, error: BaseException) -> None:
        """The reader has ended with ``error``; callers are to get it."""


class Reader:
    """Reads from ``start`` until ``closing`` is set."""

    def __init__(self, source: Source, callbacks: Callbacks, closing: threading.Event, name: str) -> None:
        self._source = source
        self._callbacks = callbacks
        self._closing = closing
        self._threads = [
            threading.Thread(target=self._guarded, args=(self._run,), name=f"biotac {name}", daemon=True),
            threading.Thread(target=self._guarded, args=(self._relieve,), name=f"biotac relief {name}", daemon=True),
        ]
        self._dispatched = 0
        self._dispatching = False
        self._give_up_s = math.inf

    def start(self) -> None:
        """Start the threads."""
        for thread in self._threads:
            thread.start()

    def join(self) -> None:
        """Wait for the threads to end; on one of them, only for the other."""
        self._give_up_s = time.monotonic() + BACKLOG_S
        for thread in self._threads:
            if thread is not threading.current_thread():
                thread.join()

    def is_here(self) -> bool:
        """Whether the caller runs on one of these threads."""
        return threading.current_thread() in self._threads

    def _guarded(self, work: Callable[[], None]) -> None:
        try:
            work()
        except BaseException as error:  # unforeseen errors too: a thread that just ended would look like a silent board
            self._source.fail(error)

    def _run(self) -> None:
        read, dispatch, is_closing = self._source.read, self._callbacks.dispatch, self._closing.is_set
        self._callbacks.thread_id = threading.get_ident()
        while not is_closing():
            read(POLL_S)
            self._dispatching = True
            while time.monotonic() < self._give_up_s and dispatch():
                self._dispatched += 1
            self._dispatching = False

    def _relieve(self) -> None:
        seen = -1
        while not self._closing.wait(RELIEF_S):
            before, seen = seen, self._dispatched
            while (
                self._dispatching
                and self._dispatched == before == seen
                and self._source.may_relieve()
                and not self._closing.is_set()
            ):
                self._source.read(RELIEF_S)
