"""The state of a board's connection, under one lock."""

from __future__ import annotations

import os
import threading
import weakref
from collections.abc import Callable
from enum import Enum
from typing import Any, NoReturn

from ..errors import DeviceLostError
from ..link import Link
from ..wire.messages_gen import Start
from .gap import Reason
from .lasting import Lasting

#: Of all hands. A hand that is garbage-collected on one of them ends on another, which may wait for it.
THREADS: weakref.WeakSet[threading.Thread] = weakref.WeakSet()


class State(Enum):
    """OPEN and STREAMING boards can be asked; a LOST one is looked for; CLOSED is for good, by the program or not."""

    OPEN = "open"
    STREAMING = "streaming"
    LOST = "lost"
    CLOSED = "closed"


class Connection:
    """The state of the board on ``link``. When the link breaks, it is lost where it ``reconnects``, else closed.

    A loss, a return and a failure wake all waiting threads. Where the program itself changes the state, the caller
    wakes them once the board has been told.
    """

    def __init__(self, link: Link, *, reconnects: bool) -> None:
        self.link = link
        self._reconnects = reconnects
        self._on_wake: Callable[[], None] = lambda: None
        #: Notified when the state changes, and when there is room for an unpaced board's batches.
        self.changed = threading.Condition()
        self.lasting = Lasting(self.changed)
        self._pid = os.getpid()
        self._own: list[threading.Thread] = []
        self.closing = False  #: by the program
        self.failure: BaseException | None = None  #: that closed it: every call from now on raises it
        self.reported = False  #: whether one did
        self.lost: Reason | None = None  #: why nothing is read, while it is looked for
        #: The running START; None before the first, after STOP, and once a source has ended.
        self.started: Start | None = None
        self.played = False  #: whether a simulated source has ended and all of it has arrived
        self.given_back = False  #: whether the port was
        self._parked = False  # the reading thread, while the board is lost

    @property
    def state(self) -> State:
        if self.is_inherited():  # whose lock a thread may have held that only the other process has
            return State.CLOSED
        with self.changed:
            if self.closing or self.failure is not None:
                return State.CLOSED
            if self.lost is not None:
                return State.LOST
            return State.OPEN if self.started is None else State.STREAMING

    @property
    def closed(self) -> bool:
        """Whether it is over, or about to be."""
        return self.closing or self.failure is not None

    def is_inherited(self) -> bool:
        """Whether this process is a fork of the one that opened the board, which alone may use it."""
        return os.getpid() != self._pid

    def check(self) -> None:
        """Raise the error that ended the connection, if there was one."""
        if self.is_inherited():
            raise DeviceLostError(
                f"this Hand on {self.link.port} belongs to the process that opened it, not to a fork of it; open "
                "boards in the process that reads them"
            )
        if self.failure is not None:
            self.reported = self.reported or not self.is_own()
            raise self.failure

    def raise_closed(self) -> NoReturn:
        """Raise the failure, or else DeviceLostError saying that the hand was closed."""
        self.check()
        raise DeviceLostError(f"this Hand on {self.link.port} was closed; open the port again")

    # ---- changes of state ----------------------------------------------------------------------

    def streams(self, started: Start | None) -> None:
        """The board was told to stream this, or nothing."""
        with self.changed:
            self.started = started

    def play_out(self) -> None:
        """The simulated source has ended, and all of it has arrived."""
        with self.changed:
            self.played, self.started = True, None
        self.wake()

    def lose(self, error: DeviceLostError, reason: Reason) -> None:
        """The link broke or the board fell silent: closed with ``error``, unless it may come back."""
        spoilt, may_return = self.link.spoilt(), self._reconnects and self.link.ports()
        with self.changed:
            if not may_return and not self.closing:
                self.failure = self.failure or (DeviceLostError(spoilt) if spoilt else error)
            self.lost = self.lost or reason
        self.wake()

    def find(self) -> None:
        """The same board is back."""
        with self.changed:
            self.lost = None
        self.wake()

    def fail(self, error: BaseException) -> None:
        """End everything with ``error``. The first of several errors counts."""
        with self.changed:
            if not self.closing:
                self.failure = self.failure or error
        self.wake()

    def close(self) -> None:
        """The program ends it. Reading goes on until the board has been told to stop, so nobody is woken here."""
        with self.changed:
            self.closing = True

    def give_back(self) -> None:
        """Close the port, while nobody writes."""
        self.given_back = True
        self.link.close()

    # ---- waiting for a change ------------------------------------------------------------------

    def on_wake(self, wake: Callable[[], None]) -> None:
        """Call ``wake``, too, whenever waiting threads are to look again."""
        self._on_wake = wake

    def wake(self) -> None:
        """Let all waiting threads look again."""
        with self.changed:
            self.changed.notify_all()
        self._on_wake()

    def wait_for(self, condition: Callable[[], Any], timeout_s: float | None = None) -> bool:
        """Wait until ``condition`` is true, looking whenever ``changed`` is notified."""
        with self.changed:
            return bool(self.changed.wait_for(condition, timeout_s))

    def park(self) -> None:
        """Wait, on the reading thread, until the board is found or the program closes it."""
        with self.changed:
            self._parked = True
            self.changed.notify_all()
            self.changed.wait_for(lambda: self.lost is None or self.closing)
            self._parked = False

    def wait_until_parked(self) -> None:
        """Wait until nothing reads the link any more."""
        self.wait_for(lambda: self._parked or self.closed)

    def thread(self, run: Callable[[], None], name: str) -> threading.Thread:
        """A thread of the hand's own, which is not the program that failures are raised to."""
        thread = threading.Thread(target=run, name=f"biotac {name} {self.link.port}", daemon=True)
        self._own.append(thread)
        THREADS.add(thread)
        return thread

    def is_own(self) -> bool:
        """Whether the caller runs on a thread of this hand."""
        return threading.current_thread() in self._own
