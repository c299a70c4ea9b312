"""Functions that are called with what arrives, and what they raised."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from ..errors import CallbackError
from ..wire import messages_gen as wire
from ..wire.batches import Batch
from .gap import Gap

Unsubscribe = Callable[[], None]


class Callbacks:
    """Who wants batches, and who wants which messages.

    What a callback raises is kept for ``report``: the first error, and how many more there were. It stays
    subscribed, and so do the others.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._on_batch: list[Callable[[Batch], Any]] = []
        self._on_message: dict[type[Any], list[Callable[[Any], Any]]] = {}
        self.wanted = False  #: somebody wants something
        self._error: Exception | None = None
        self._culprit = ""
        self._more = 0

    def on_batch(self, fn: Callable[[Batch], Any]) -> Unsubscribe:
        """Call ``fn`` with every batch."""
        return self._add(lambda: self._on_batch, lambda new: setattr(self, "_on_batch", new), fn)

    def on_message(self, kind: type[Any], fn: Callable[[Any], Any]) -> Unsubscribe:
        """Call ``fn`` with every message of a kind."""

        def change(new: list[Callable[[Any], Any]]) -> None:
            changed = {**self._on_message, kind: new}
            self._on_message = {k: fns for k, fns in changed.items() if fns}

        return self._add(lambda: self._on_message.get(kind, []), change, fn)

    def _add(self, now: Callable[[], list[Any]], change: Callable[[list[Any]], None], fn: Any) -> Unsubscribe:
        # Lists are replaced and never changed: the reader may be walking through one.
        with self._lock:
            change([*now(), fn])
            self.wanted = True
        done = False

        def unsubscribe() -> None:
            nonlocal done
            with self._lock:
                if not done:
                    left = now().copy()
                    left.remove(fn)
                    change(left)
                    self.wanted = bool(self._on_batch or self._on_message)
                done = True

        return unsubscribe

    def call(self, batch: Batch) -> None:
        """Hand a batch around."""
        for fn in self._on_batch:
            try:
                fn(batch)
            except Exception as error:
                self._keep(fn, error)
        if not (batch.messages and self._on_message):
            return
        for message in batch.messages:
            for fn in self._on_message.get(type(message), ()):
                try:
                    fn(message)
                except Exception as error:
                    self._keep(fn, error)

    def _keep(self, fn: Callable[[Any], Any], error: Exception) -> None:
        with self._lock:
            if self._error is None:
                self._error, self._culprit = error, getattr(fn, "__qualname__", repr(fn))
            else:
                self._more += 1

    def report(self) -> None:
        """Raise CallbackError once for what callbacks have raised since the last report."""
        if self._error is None:
            return
        with self._lock:
            error, culprit, more = self._error, self._culprit, self._more
            self._error, self._more = None, 0
        again = f", and {more} more error(s) since" if more else ""
        raise CallbackError(f"callback {culprit} raised {type(error).__name__}: {error}{again}; correct it") from error


#: What Hand.on_* offer beside batches.
MESSAGES = {"touch": wire.Touch, "tare": wire.Tare, "status": wire.Status, "gap": Gap}
