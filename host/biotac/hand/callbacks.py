"""Functions that are called with what arrives, and the errors they raised."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from ..errors import CallbackError
from ..wire.batches import Batch
from .queue import BatchQueue

Unsubscribe = Callable[[], None]


class Callbacks:
    """The callbacks, and the batches that wait for them.

    What callbacks raise is kept for ``report``: the first error, and how many more there were. A callback that raised
    stays subscribed.
    """

    def __init__(self) -> None:
        self.queue = BatchQueue()
        self.thread_id = 0  #: the thread that calls ``dispatch``, by threading.get_ident()
        self._next: Batch | None = None  # comes before everything in the queue
        self._lock = threading.Lock()
        self._wanted: list[tuple[type[Any], Callable[[Any], Any]]] = []  # replaced, never changed
        self._error: BaseException | None = None
        self._culprit = ""
        self._more = 0

    def add(self, kind: type[Any], fn: Callable[[Any], Any]) -> Unsubscribe:
        """Call ``fn`` with every message of a kind, or with every Batch; returns a function that ends this."""
        entry = (kind, fn)

        def unsubscribe() -> None:
            with self._lock:
                self._wanted = [one for one in self._wanted if one is not entry]

        with self._lock:
            self._wanted = [*self._wanted, entry]
        return unsubscribe

    def wants(self, kind: type[Any]) -> bool:
        """Whether a callback wants such messages."""
        return any(one is kind for one, _ in self._wanted)

    def put(self, batch: Batch) -> None:
        """Take a batch that has arrived, for ``dispatch``."""
        if not self._wanted:
            return
        if self._next is None and not self.queue.rows and self.thread_id == threading.get_ident():
            self._next = batch  # this thread dispatches it next
        else:
            self.queue.put(batch)

    def dispatch(self) -> bool:
        """Call every callback that wants the oldest batch or its messages; false when no batch waits."""
        batch = self._next
        if batch is not None:
            self._next = None
        elif (batch := self.queue.take()) is None:
            return False
        wanted = self._wanted
        for one in (batch, *batch.messages):
            for kind, fn in wanted:
                if type(one) is kind:
                    try:
                        fn(one)
                    except BaseException as error:  # SystemExit too: a thread that ended would look like silence
                        self._keep(fn, error)
        return True

    def leave(self) -> None:
        """Discard what waits and count it as skipped."""
        if self._next is not None:
            self.queue.put_back(self._next)
            self._next = None
        self.queue.leave()

    def _keep(self, fn: Callable[[Any], Any], error: BaseException) -> None:
        with self._lock:
            if self._error is None:
                self._error, self._culprit = error, getattr(fn, "__qualname__", repr(fn))
            else:
                self._more += 1

    def report(self) -> None:
        """Raise CallbackError for what callbacks have raised since the last report, if anything."""
        if self._error is None:
            return
        with self._lock:
            error, culprit, more = self._error, self._culprit, self._more
            self._error, self._more = None, 0
        again = f", and {more} more error(s) since" if more else ""
        raise CallbackError(f"callback {culprit} raised {type(error).__name__}: {error}{again}; fix it") from error
