"""Batches on their way to one consumer, who may be slow."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable

from ..wire.batches import Batch

# Ten to twenty seconds of five fingers with PAC; a few tens of megabytes.
LIMIT_ROWS = 16_384


class BatchQueue:
    """First in, first out. With a limit (``bound``), a full queue drops its oldest batches and counts them."""

    def __init__(self, wake: Callable[[], None] | None = None, taken: Callable[[], None] | None = None) -> None:
        self._wake = wake  # tells the consumer to look
        self._taken = taken  # tells that there is room again
        self._limit_rows: int | None = None
        self._batches: deque[Batch] = deque()
        #: How many rows wait; a batch of messages alone counts as one.
        self.rows = 0
        self._lock = threading.Lock()
        self.batches_skipped = 0
        self.frames_skipped = 0

    def bound(self, limit_rows: int | None) -> None:
        """Keep at most so many rows (frames, PAC blocks and heartbeats), dropping the oldest; None: keep all."""
        self._limit_rows = limit_rows

    def put(self, batch: Batch) -> None:
        """Add the newest batch."""
        with self._lock:
            self._batches.append(batch)
            self.rows += weight(batch)
            # The newest batch stays, however large it is.
            while self._limit_rows is not None and self.rows > self._limit_rows and len(self._batches) > 1:
                oldest = self._batches.popleft()
                self.rows -= weight(oldest)
                self._skip(oldest)
        self.wake()

    def _skip(self, batch: Batch) -> None:
        self.batches_skipped += 1
        self.frames_skipped += len(batch.wire)

    def wake(self) -> None:
        """Tell the consumer to look."""
        if self._wake is not None:
            self._wake()

    def put_back(self, batch: Batch) -> None:
        """Return a batch that was taken and not used."""
        with self._lock:
            self._batches.appendleft(batch)
            self.rows += weight(batch)

    def clear(self) -> None:
        """Discard what waits without counting it; the consumer does not want it."""
        while self.take() is not None:
            pass

    def leave(self) -> None:
        """Discard what waits and count it as skipped: the consumer has no more time for it."""
        while (batch := self.take()) is not None:
            self._skip(batch)

    def take(self) -> Batch | None:
        """Take the oldest batch; None when there is none."""
        if not self._batches:
            return None
        with self._lock:
            if not self._batches:
                return None
            batch = self._batches.popleft()
            self.rows -= weight(batch)
        if self._taken is not None:
            self._taken()
        return batch


def weight(batch: Batch) -> int:
    """How many rows a batch has, at least one."""
    return len(batch.wire) + len(batch.pac) + len(batch.idle) or 1
