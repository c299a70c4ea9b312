"""The threads that read a link, so that nobody has to ask for it and the board's ring never fills.

Callbacks run on the reading thread, for the least delay. One that takes long would keep the link waiting: then a
second thread, the relief, reads until it is done. With a board whose time waits for its reader (Link.pace 0) it is
the other way round: reading waits for slow consumers, and nothing is dropped.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from threading import get_ident
from typing import Protocol

# How long a link is waited for at most before other things are looked at.
POLL_S = 0.2
# A callback that runs for two of these is relieved. The Pico's ring holds 16 KiB, of five fingers 0.2 s.
RELIEF_S = 0.04


class Read(Protocol):
    """The side of a hand that its reader works on."""

    closing: threading.Event

    def read_once(self, timeout_s: float) -> None:
        """Wait for bytes, decode and hand them out; come back from a lost link."""

    def keep_up(self) -> float:
        """Do what is due: ping, notice silence or the end of a source. Returns for how many s it need not be called."""

    def wait_for_room(self) -> None:
        """Where nothing may be dropped: wait until consumers have room, or somebody awaits a reply."""

    def dispatch(self) -> bool:
        """Call the callbacks with one batch; False when none waits."""

    def may_relieve(self) -> bool:
        """Whether the link may be read on while a callback takes its time."""

    def fail(self, error: BaseException) -> None:
        """The reader is over; everybody is to know why."""


class Reader:
    """Reads from ``start`` until ``closing`` is set."""

    def __init__(self, hand: Read, name: str) -> None:
        self._hand = hand
        self._thread = threading.Thread(target=self._guarded(self._run), name=f"biotac {name}", daemon=True)
        self._relief = threading.Thread(target=self._guarded(self._relieve), name=f"biotac relief {name}", daemon=True)
        self.dispatcher = 0  #: the thread that calls ``dispatch``, by threading.get_ident()
        self._dispatched = 0
        self._dispatching = False

    def start(self) -> None:
        """Begin."""
        self._thread.start()
        self._relief.start()

    def join(self) -> None:
        """Wait for the end, unless this is a callback of it."""
        if not self.is_here():
            self._thread.join()
            self._relief.join()

    def is_here(self) -> bool:
        """The caller runs on one of these threads."""
        return threading.current_thread() in (self._thread, self._relief)

    def _guarded(self, work: Callable[[], None]) -> Callable[[], None]:
        def run() -> None:
            try:
                work()
            except BaseException as error:  # also what nobody foresaw: a silent end would look like silence
                self._hand.fail(error)

        return run

    def _run(self) -> None:
        hand = self._hand
        is_closing = hand.closing.is_set
        self.dispatcher = get_ident()
        while not is_closing():
            hand.wait_for_room()
            hand.read_once(min(POLL_S, hand.keep_up()))
            self._dispatching = True
            while hand.dispatch():
                self._dispatched += 1
            self._dispatching = False

    def _relieve(self) -> None:
        hand = self._hand
        seen = -1
        while not hand.closing.wait(RELIEF_S):
            before, seen = seen, self._dispatched
            while (
                self._dispatching
                and self._dispatched == before == seen
                and hand.may_relieve()
                and not hand.closing.is_set()
            ):
                hand.read_once(min(RELIEF_S, hand.keep_up()))
