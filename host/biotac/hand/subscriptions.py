"""Functions of the program that are called with arriving messages."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

from ..board.consumers import Callbacks, Unsubscribe
from ..board.gap import Gap
from ..board.reader import Reader
from ..board.stream import Stream
from ..wire import messages_gen as wire
from ..wire.batches import Batch
from .reading import Reading
from .views import Latest


class Subscriptions:
    """Each method asks the board for the messages, and omits those that are too old to react to."""

    _reader: Reader
    _stream: Stream
    _callbacks: Callbacks
    _reading: Reading
    _latest: Latest

    def on_batch(self, fn: Callable[[Batch], Any]) -> Unsubscribe:
        """Call ``fn`` with every batch; returns a function that ends this.

        Callbacks of a hand run in one thread, in order, and may give commands. Slow callbacks lose the oldest batches,
        counted in ``stats`` and reported by a Gap; the link is still read. An error of one is logged, and raised as
        CallbackError by the next call of any kind on the hand or a finger. The stream starts with ``stream``, or
        with the first read.
        """
        return self._on(Batch, fn)

    def on_event(self, fn: Callable[[wire.Event], Any]) -> Unsubscribe:
        """Call ``fn`` with every EVENT (touch, lift, jolt, slip and slip's end, see EventKind) as soon as it arrives.

        Adds events to the stream. Events older than ``max_age_s`` (biotac.open), delayed while this program stood
        still, are omitted; batches and recordings have them. The same holds for ``on_touch`` and ``on_slip``.
        """
        return self._on(wire.Event, self._if_new(fn))

    def on_slip(self, fn: Callable[[wire.Event], Any]) -> Unsubscribe:
        """Call ``fn`` when a held object begins to slip: with the events of ``on_event`` that are SLIP."""
        return self._on(wire.Event, self._if_new(fn, wire.EventKind.SLIP))

    def on_touch(self, fn: Callable[[wire.Touch], Any]) -> Unsubscribe:
        """Call ``fn`` as soon as a resting finger's signals move, within the round: a hint that CONTACT may follow.

        Adds touch to the stream.
        """
        return self._on(wire.Touch, self._if_new(fn))

    def on_tare(self, fn: Callable[[wire.Tare], Any]) -> Unsubscribe:
        """Call ``fn`` with every change of a tare."""
        return self._on(wire.Tare, fn)

    def on_status(self, fn: Callable[[wire.Status], Any]) -> Unsubscribe:
        """Call ``fn`` with each STATUS, the board's counters, which comes every second by default."""
        return self._on(wire.Status, fn)

    def on_gap(self, fn: Callable[[Gap], Any]) -> Unsubscribe:
        """Call ``fn`` when rows are missing and the next ones have come: see Gap."""
        return self._on(Gap, fn)

    def _on(self, kind: type[Any], fn: Callable[[Any], Any]) -> Unsubscribe:
        self._latest.report()
        self._reading.stop_buffering()
        self._stream.imply(kind)
        return self._callbacks.add(kind, fn)

    def _if_new(self, fn: Callable[[Any], Any], kind: wire.EventKind | None = None) -> Callable[[Any], Any]:
        reader, max_age_s = self._reader, self._latest.max_age_s

        @wraps(fn)
        def call(message: Any) -> None:
            is_old = reader.age_s(message.t_us) > max_age_s  # the first message after a restart has no known age
            if kind in (None, getattr(message, "kind", None)) and not is_old:
                fn(message)

        return call
