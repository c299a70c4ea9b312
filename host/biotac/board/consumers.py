"""Consumers of batches from the reading thread: queues, and callbacks."""

from __future__ import annotations

import logging
import math
import threading
import time
import weakref
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from queue import Empty, SimpleQueue
from typing import Any

from ..errors import CallbackError
from ..wire.batches import Batch
from .gap import Gap
from .reader import Consumer, Reader

# Ten to twenty seconds of five fingers with PAC; a few tens of megabytes.
LIMIT_ROWS = 16_384
# At the end, waiting batches go to callbacks for this long; the others are skipped.
BACKLOG_S = 1.0

Unsubscribe = Callable[[], None]


class Queue(Consumer):
    """Batches on their way to a consumer that may be slow, first in, first out.

    A full queue drops and counts the oldest batches; their Gaps stay, and a Gap says how many rows are missing. An
    unpaced board waits instead. Until the queue is read, a dropped batch is nobody's loss. ``on_news`` is called on the
    reading thread, and makes the consumer look.
    """

    def __init__(self, reader: Reader, on_news: Callable[[], None] | None = None, *, is_read: bool = True) -> None:
        self.is_read = is_read  #: whether a consumer reads it
        self._reader = reader
        self._on_news = on_news
        # Thousands of times a second: this wakes the consumer at a fifth of a Condition's cost. None only wakes.
        self._waiting: SimpleQueue[Batch | None] = SimpleQueue()
        self._back: list[Batch] = []  # unused by the consumer
        # Rows put and dropped here, and taken: each counted by one thread. A batch of messages alone counts as one.
        self._put_rows = self._read_rows = 0
        self._has_rows = False  # messages alone make no board wait
        self._before: Batch | None = None  # the latest with frames that was taken
        self._slow: Gap | None = None
        self._gaps: list[Gap] = []  # of batches that were dropped

    def begin(self) -> None:
        """The consumer reads from now on."""
        self.is_read = True

    def put(self, batch: Batch) -> None:
        self._waiting.put(batch)
        self._put_rows += weight(batch)
        self._has_rows |= bool(len(batch.wire) or len(batch.pac) or len(batch.idle))
        # The newest batch stays, however large it is.
        while self._put_rows - self._read_rows > LIMIT_ROWS and self._waiting.qsize() > 1:
            self._skip()
        if self._on_news is not None:
            self._on_news()

    def wake(self) -> None:
        self._waiting.put(None)
        if self._on_news is not None:
            self._on_news()

    def is_full(self) -> bool:
        return self._has_rows and self._put_rows > self._read_rows

    def get(self, *, wait: bool = False, timeout_s: float | None = None) -> Batch | None:
        """Take the oldest batch. None when there is none; with ``wait``, when there is none but a wake, or in time."""
        if self._back:
            return self._back.pop()
        batch = None
        while batch is None:
            try:
                batch = self._waiting.get(wait, timeout_s)
            except Empty:
                return None
            if batch is None and wait and self._waiting.empty():
                return None
        self._read_rows += weight(batch)
        self._has_rows &= self._put_rows > self._read_rows
        self._reader.notify_space()
        if self._slow is not None or self._gaps:
            batch = self._with_gaps(batch)
        if len(batch.wire):
            self._before = batch
        return batch

    def put_back(self, batch: Batch) -> None:
        """Return a batch that was taken and not used."""
        self._back.append(batch)
        self._back.sort(key=lambda batch: -(batch.first_t_us() or 0))  # loops end in any order, also one within another

    def clear(self) -> None:
        """Discard waiting batches without counting them: the consumer does not want them."""
        while self.get() is not None:
            pass

    def skip_all(self) -> None:
        """Discard waiting batches and count them as skipped: the consumer has no more time."""
        for batch in self._back:
            self._reader.skipped(batch)
        while not self._waiting.empty():
            self._skip()

    def _skip(self) -> None:
        with suppress(Empty):  # the consumer took it meanwhile
            batch = self._waiting.get(False)
            if batch is None:
                return
            self._put_rows -= weight(batch)
            self._gaps += [m for m in batch.messages if isinstance(m, Gap)]
            if not self.is_read:
                return
            self._reader.skipped(batch)
            first_us = batch.first_t_us()
            if first_us is not None and self._slow is None:
                self._slow = Gap("slow", None, None, time.time_ns(), 0, self._reader.hello.boot_id, frames_missed=0)
            if self._slow is not None:
                frames, fingers = (self._slow.frames_missed or 0) + len(batch.wire), self._slow.fingers
                self._slow = replace(self._slow, frames_missed=frames, fingers=fingers | max(0, batch.fingers))

    def _with_gaps(self, batch: Batch) -> Batch:
        gaps, self._gaps = self._gaps, []
        slow, first_us = self._slow, batch.first_t_us()
        if slow is not None and first_us is not None:
            last_us = None if self._before is None else self._before.last_t_us()
            gaps.append(replace(slow, last_t_us=last_us, next_t_us=first_us, back_at_ns=time.time_ns()))
            self._slow = None
        # The other consumers have the same batch.
        return replace(batch, messages=[*gaps, *batch.messages])


def weight(batch: Batch) -> int:
    """How many rows a batch has, at least one."""
    return len(batch.wire) + len(batch.pac) + len(batch.idle) or 1


class DeferredErrors:
    """Errors of callbacks and recordings, until they are raised to the program: the first, and how many more."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._first: BaseException | None = None
        self._more = 0

    def add(self, error: BaseException) -> None:
        with self._lock:
            if self._first is None:
                self._first = error
            else:
                self._more += 1

    def report(self) -> None:
        """Raise the errors since the last report, if there were any."""
        if self._first is None:
            return
        with self._lock:
            first, more, self._first, self._more = self._first, self._more, None, 0
        if isinstance(first, CallbackError):
            again = f", and {more} more error(s) since" if more else ""
            raise CallbackError(f"{first}{again}; fix it") from first.__cause__
        if first is not None:
            raise first


class Wanted(dict[object, tuple[type[Any], Callable[[Any], Any]]]):
    """Functions, each with the kind of message that it wants."""


class Callbacks:
    """Functions that are called with batches, or with messages of one kind, on a thread of their own.

    A slow function's batches are dropped, as by every Queue. Errors are logged at once and collected in ``troubles``;
    the function stays subscribed. ``wanted`` belongs to the hand: functions may refer to the hand, and this thread
    would otherwise hold it for ever.
    """

    def __init__(self, reader: Reader, troubles: DeferredErrors, wanted: Wanted) -> None:
        self._wanted = weakref.ref(wanted)
        self._queue = Queue(reader)
        self._reader = reader
        self._troubles = troubles
        self._lock = threading.Lock()
        self._thread = reader.connection.thread(self._run, "callbacks")
        self._give_up_s = math.inf

    def add(self, kind: type[Any], fn: Callable[[Any], Any]) -> Unsubscribe:
        """Call ``fn`` with every message of a kind, or with every Batch; returns a function that ends this."""
        key, wanted = object(), self._wanted()
        assert wanted is not None  # the hand of this call has it
        wanted[key] = kind, fn
        with self._lock:
            if self._thread.ident is None:
                self._thread.start()
                self._reader.add(self._queue)

        def unsubscribe() -> None:
            wanted.pop(key, None)

        return unsubscribe

    def close(self) -> None:
        """Pass waiting batches on for up to one more second, and end; a running callback is waited for."""
        self._reader.close()  # the last batch has arrived, too
        self._give_up_s = time.monotonic() + BACKLOG_S
        self._queue.wake()
        if self._thread.ident is not None:
            self._thread.join()
        self._queue.skip_all()

    def _run(self) -> None:
        try:
            while True:
                closing = self._give_up_s < math.inf
                batch = self._queue.get(wait=not closing)
                if batch is not None and time.monotonic() < self._give_up_s:
                    self._call(batch)
                elif batch is not None:
                    self._queue.put_back(batch)
                    return
                elif closing:
                    return
        except BaseException as error:  # unforeseen errors too: a thread that just ended would look like silence
            self._reader.connection.fail(error)

    def _call(self, batch: Batch) -> None:
        wanted = list((self._wanted() or {}).values())
        for item in (batch, *batch.messages):
            for kind, fn in wanted:
                if type(item) is kind:
                    try:
                        fn(item)
                    except BaseException as error:  # SystemExit too: a thread that ended would look like silence
                        self._failed(fn, error)

    def _failed(self, fn: Callable[[Any], Any], error: BaseException) -> None:
        name = getattr(fn, "__qualname__", repr(fn))
        logging.getLogger("biotac").error("callback %s failed", name, exc_info=error)
        raised = CallbackError(f"callback {name} raised {type(error).__name__}: {error}")
        raised.__cause__ = error
        self._troubles.add(raised)
