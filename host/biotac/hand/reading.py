"""Reading in order: one thread of the program reads one queue, which begins with the stream."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from ..board.board import Board
from ..board.consumers import Queue
from ..board.recovery import SILENCE_S
from ..board.stream import Stream
from ..errors import InputError
from ..wire import messages_gen as wire
from ..wire.batches import Batch, join, split
from .views import Latest

GIVEN_UP_S = 2.0  # how long an abandoned read may need to end, if the program's loop lets it


class Reading:
    """``Hand.batches``, ``frames`` and ``read``, which share one queue."""

    def __init__(self, board: Board, stream: Stream, latest: Latest) -> None:
        self._board = board
        self._reader = board.reader
        self._stream = stream
        self._latest = latest
        self._queue = Queue(self._reader, is_read=False)
        self._thread: threading.Thread | None = None  # reads, in so many unended iterations
        self._iterations = 0
        self._turn = threading.Condition()
        self._given_up: set[threading.Thread] = set()  # threads whose read nobody waits for any more
        self._reader.add(self._queue)

    def stop_buffering(self) -> None:
        """Buffer no rows for a first read: the program reads in another way."""
        if not self._queue.is_read:
            self._reader.remove(self._queue)

    def add_queue(self, on_news: Callable[[], None]) -> Queue:
        """A new queue of everything from now on; ``on_news`` is called on the reading thread."""
        self._latest.report()
        self.stop_buffering()
        queue = Queue(self._reader, on_news)
        self._reader.add(queue)
        return queue

    def start(self) -> None:
        """Start the stream with the latest choice, unless it runs."""
        self._latest.report()
        self._stream.ensure_started()

    def batches(self, every_s: float | None = None) -> Iterator[Batch]:
        """See Hand.batches, which keeps the hand open meanwhile."""
        stream, connection = self._stream, self._reader.connection
        with self._by_one_thread():
            self._begin()
            self.start()
            while True:
                self._latest.report()
                if self._given_up and threading.current_thread() in self._given_up:
                    raise InputError("this read was given up, by a timeout or a cancelled task; read again")
                over = not stream.on  # before the queue is emptied, so that nothing is left in it
                batch = self._queue.get(wait=not (over or connection.closed), timeout_s=every_s)
                if batch is not None:
                    yield batch
                elif connection.closed:
                    connection.raise_closed()
                elif over:
                    return
                elif every_s is not None:
                    yield join([])

    def _begin(self) -> None:
        if self._queue not in self._reader.consumers:
            self._queue = Queue(self._reader)
            self._reader.add(self._queue)
        self._queue.begin()

    @contextmanager
    def _by_one_thread(self) -> Iterator[None]:
        here = threading.current_thread()
        with self._turn:
            self._turn.wait_for(lambda: self._thread not in self._given_up, GIVEN_UP_S)  # its batch is back
            before = self._thread
            if self._iterations and before is not None and before is not here and before.is_alive():
                raise InputError(
                    f"thread {before.name!r} is reading this hand, and {here.name!r} would take part of its data; "
                    "read in one thread, end its loop or close its generator, or give each an on_batch callback"
                )
            self._iterations = self._iterations + 1 if before is here else 1
            self._thread = here
        try:
            yield
        finally:  # in whichever order generators are closed
            with self._turn:
                self._iterations -= self._thread is here
                self._turn.notify_all()

    def give_up(self, thread: threading.Thread) -> None:
        """End the read of ``thread``: nobody waits for it any more. The rows come with the next read."""
        with self._turn:
            self._given_up.add(thread)
        self._queue.wake()

    def may_read(self, thread: threading.Thread) -> None:
        """Undo ``give_up`` once that read has ended."""
        with self._turn:
            self._given_up.discard(thread)
            self._turn.notify_all()

    def put_back(self, batch: Batch) -> None:
        """Let the next read begin with a batch that was taken and not used."""
        self._queue.put_back(batch)

    def read_batch(self, seconds: float, fresh: bool) -> Batch:
        """See Hand.read_batch."""
        if not 0 < seconds < float("inf"):
            raise ValueError(f"seconds is {seconds}, expected a number above 0")
        if fresh and self._stream.on:
            self._board.command(wire.Ping(0))  # a barrier: the reply comes after everything made before
            self._queue.clear()
        found: list[Batch] = []
        try:
            return self._read_batch(seconds, found)
        except BaseException:
            if found:
                self.put_back(join(found))  # so that it is read next
            raise

    def _read_batch(self, seconds: float, found: list[Batch]) -> Batch:
        end_us: int | None = None
        first_status_us: int | None = None
        for batch in self.batches():
            first_us, last_us = batch.first_t_us(), batch.last_t_us()
            if end_us is None and first_us is not None:
                end_us = first_us + round(seconds * 1e6)
            for status in (m for m in batch.messages if isinstance(m, wire.Status)):
                first_status_us = status.t_us if first_status_us is None else first_status_us
                if end_us is None and (status.t_us - first_status_us) % 2**32 > (seconds + SILENCE_S) * 1e6:
                    return join([*found, batch])  # the board is there, the sensors are not
            if end_us is None or last_us is None or last_us < end_us:
                found.append(batch)
                continue
            now, later = split(batch, end_us)
            self._queue.put_back(later)
            return join([*found, now])
        return join(found)
