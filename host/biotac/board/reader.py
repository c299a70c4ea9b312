"""The one thread that reads a board, from open to close.

Bytes go one way: the link, the decoder, a batch, the consumers. Reading waits for nobody: a consumer that is too slow
loses the oldest batches (consumers.py). Only an unpaced board is the other way round: device time waits for the
reader, so reading waits until every consumer has read everything, or somebody awaits a reply.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ..clock import LAST_SAMPLE_US, Arrivals, DeviceClock
from ..errors import DeviceLostError
from ..link.serial_port import disconnected
from ..wire import messages_gen as wire
from ..wire.batches import ROUND_US, Batch, LinkStats, StreamDecoder
from .connection import Connection
from .gap import Gaps, Reason
from .replies import Replies

# The longest wait for a link before other conditions are checked, such as closing.
POLL_S = 0.2


class Consumer(Protocol):
    """Takes batches on the reading thread, which must not wait for it."""

    def put(self, batch: Batch) -> None:
        """Take a batch that has arrived."""

    def wake(self) -> None:
        """Look again: the stream has ended, or the board is lost."""
        return

    def is_full(self) -> bool:
        """Whether an unpaced board has to wait for this consumer."""
        return False


@runtime_checkable
class Tap(Consumer, Protocol):
    """Gets the bytes themselves too, before their batch is put."""

    def put_raw(self, chunk: bytes, batch: Batch) -> None:
        """Take bytes as they arrived, and the batch that they completed."""


class Reader:
    """Reads the link of ``connection`` into ``clock`` and the consumers; ``hello`` is the board's.

    When the link breaks, reading stops: for good, or where the connection may come back until ``resume`` (recovery.py).
    """

    def __init__(self, connection: Connection, hello: wire.Hello, messages: Mapping[int, type[Any]]) -> None:
        self.connection = connection
        self.link = link = connection.link
        self._messages = messages
        #: The board's HELLO, from when it was opened or last came back.
        self.hello = hello
        self.clock = DeviceClock(unix_offset_s=time.time() - time.monotonic())
        connection.on_wake(self._wake_consumers)
        self.present = hello.fingers_present  #: bit mask of the fingers that have ever answered
        self._every = 1  # consumers get frames with a seq that is a multiple of this
        self.rows = 0  #: how many batches with rows have come
        self._batches_skipped = self._frames_skipped = 0
        self.last_t_us: int | None = None  #: device time of the latest frame or heartbeat
        self._round0_us: int | None = None  # device time of round 0, of the boot that the board was opened in
        self.silent_s = 0.0  #: for how long it has listened in vain
        self.replies = Replies()
        self.gaps = Gaps(connection.lasting, connection.changed)
        self.consumers: tuple[Consumer, ...] = ()
        self._taps: tuple[Tap, ...] = ()
        self._taking = threading.Lock()  # of a shared link, until the consumers have the batch
        self._decoder = _decoder(hello, self._messages)
        self._past: list[LinkStats] = []  # of decoders before a reboot
        self._bytes = self._frames = 0
        self._arrivals = Arrivals(self.clock)
        self._waits_for_room = link.pace == 0 and not link.lock_step
        self._thread = self.connection.thread(self._run, "reader")
        self.start = self._thread.start

    def add(self, consumer: Consumer) -> None:
        """Pass everything that arrives from now on to ``consumer`` too."""
        with self.connection.changed:
            self._set((*self.consumers, consumer))

    def remove(self, consumer: Consumer) -> None:
        """Pass nothing more to ``consumer``."""
        with self.connection.changed:
            self._set(tuple(other for other in self.consumers if other is not consumer))
            self.connection.changed.notify_all()

    def _set(self, consumers: tuple[Consumer, ...]) -> None:
        self.consumers = consumers
        self._taps = tuple(tap for tap in consumers if isinstance(tap, Tap))

    # ---- changes of the connection -------------------------------------------------------------

    def resume(self, hello: wire.Hello) -> Reason:
        """Read on: the link was opened again, and the same board answered with ``hello``. Returns why it was away."""
        reason: Reason = self.connection.lost or "silence"
        if hello.boot_id != self.hello.boot_id:
            reason = "rebooted"
            self._past.append(self._decoder.stats(0, 0))
            self._decoder = _decoder(hello, self._messages)
            self.clock.restart()
            self._arrivals.forget()
            self._round0_us = None  # a source plays on during the board's restart
        else:
            self._decoder.feed(b"\0")  # ends a packet that was cut off halfway
        self.gaps.begin(reason)  # before START, because rows may come with the reply
        self.hello = hello
        self.met(hello.fingers_present)
        self.connection.find()
        return reason

    def met(self, fingers: int) -> None:
        """The sensors of this bit mask have answered."""
        with self.connection.changed:
            self.present |= fingers

    def thin_to(self, every: int) -> None:
        """Give consumers only frames with a seq that is a multiple of this."""
        self._every = every

    def skipped(self, batch: Batch) -> None:
        """Count a batch that a slow consumer's queue dropped."""
        with self.connection.changed:
            self._batches_skipped += 1
            self._frames_skipped += len(batch.wire)

    def _wake_consumers(self) -> None:
        for consumer in self.consumers:
            consumer.wake()
        self.link.wake()

    def notify_space(self) -> None:
        """Read on, where reading waits for room: somebody took a batch, or awaits a reply."""
        if self._waits_for_room:
            with self.connection.changed:
                self.connection.changed.notify_all()

    def close(self) -> None:
        """Stop reading and wait until it has stopped."""
        self.connection.close()
        self.connection.wake()
        if self._thread.ident is not None:
            self._thread.join()

    @property
    def stats(self) -> LinkStats:
        """Counts since the handshake, over reboots too."""
        now = self._decoder.stats(self._bytes, self._frames)
        counted = ("frames_lost", "pac_lost", "disordered", "crc_errors", "other_errors", "unknown_messages")
        lost = {name: sum(getattr(stats, name) for stats in (*self._past, now)) for name in counted}
        skipped = {"batches_skipped": self._batches_skipped, "frames_skipped": self._frames_skipped}
        return replace(now, gaps=self.gaps.count, **skipped, **lost)

    # ---- reading -------------------------------------------------------------------------------

    def _run(self) -> None:
        connection = self.connection
        try:
            while not connection.closing:
                if connection.lost is not None:
                    connection.park()
                elif self._waits_for_room and self._is_full():
                    connection.wait_for(lambda: connection.lost or connection.closing or not self._is_full())
                else:
                    self._read()
        except BaseException as error:  # unforeseen errors too: a thread that just ended would look like a silent board
            connection.fail(error)

    def _is_full(self) -> bool:
        if self.replies.awaited:
            return False
        return any(consumer.is_full() for consumer in self.consumers)

    def take(self, read: Callable[[], bytes]) -> None:
        """Pass on what ``read`` returns, as the reading thread does: for a program that advances a board's time."""
        with self._taking:
            chunk = read()
            if chunk:
                self._arrived(self._fed(chunk))

    def _read(self) -> None:
        had_ended = self.link.ended
        try:
            if self.link.shares_reading:
                self.link.await_news(POLL_S)
                self.take(lambda: self.link.read(0.0))
                return
            batch = self._next()
        except DeviceLostError as error:
            self.connection.lose(error, "unplugged")
            return
        except OSError as error:
            self.connection.lose(disconnected(self.link.port, error), "unplugged")
            return
        self.silent_s = 0.0 if batch is not None else self.silent_s + POLL_S
        if batch is not None:
            self._arrived(batch)
        if self.link.ended and not had_ended:
            self.connection.wake()

    def _next(self) -> Batch | None:
        fd, decoder = self.link.fd, self._decoder
        if fd is not None:
            batch = decoder.read(fd, POLL_S)
            if batch is not None and self._taps:
                self._tap(decoder.chunk(), batch)
            return batch
        chunk = self.link.read(POLL_S)
        return self._fed(chunk) if chunk else None

    def _fed(self, chunk: bytes) -> Batch:
        batch = self._decoder.feed(chunk, time.monotonic())
        self._tap(chunk, batch)
        return batch

    def _tap(self, chunk: bytes, batch: Batch) -> None:
        for tap in self._taps:
            tap.put_raw(chunk, batch)

    def _arrived(self, batch: Batch) -> None:
        messages = batch.messages
        batch.messages = self.replies.for_all(messages)
        counted = self._counted(batch)
        if counted is not None:
            for consumer in self.consumers:
                consumer.put(counted)
        # Now, so that with the reply everything before it has reached every consumer.
        if messages and self.replies.awaited:
            self.replies.put(messages, batch.arrived_s)
            with self.connection.changed:
                self.connection.changed.notify_all()

    def _counted(self, batch: Batch) -> Batch | None:
        """``batch`` for the consumers, counted and with any Gap; None when it is empty."""
        decoder = self._decoder
        self._bytes += decoder.taken
        last_us = decoder.last_t_us
        if last_us is not None:
            self.rows += 1
            self._frames += len(batch.wire)
            self._arrivals.note(last_us + LAST_SAMPLE_US, batch.arrived_s)
            batch.taken_s = self.taken_s(last_us, batch.arrived_s)
            if self.last_t_us is None:
                idle_us = batch.idle["t_us"] - ROUND_US * batch.idle["seq"].astype(np.int64)
                self._round0_us = min([*(batch.t_us - ROUND_US * batch.seq).tolist(), *idle_us.tolist()], default=None)
            self.last_t_us = last_us
            self.gaps.through(batch, last_us, self.hello.boot_id, decoder.lost_after)
        elif len(batch.pac):
            self.rows += 1
        elif not batch.messages:
            return None
        return batch if self._every == 1 else thin(batch, self._every)

    def applied_n(self, finger: NDArray[np.uint8], t_us: NDArray[np.int64]) -> NDArray[np.float64] | None:
        """Force (n, 3) in N on simulated fingers (n,) at rows' times (n,), NaN if unknown; None: real or restarted."""
        return self.link.applied_n(finger, t_us, self._round0_us)

    # ---- device time and host time -------------------------------------------------------------

    def taken_s(self, t_us: int, arrived_s: float) -> float:
        """When the last sample of a round was taken, by time.monotonic(); NaN while the board's clock is unknown.

        An unpaced board's row counts as just read.
        """
        if not self.link.keeps_time:
            return arrived_s
        # A row was taken before it came, whatever the clock's estimate says. NaN is never smaller.
        return min(self.clock.estimate_s(t_us + LAST_SAMPLE_US), arrived_s)

    def age_s(self, t_us: int) -> float:
        """How long ago a message with this 32-bit device time was made; NaN while the board's clock is unknown."""
        if not self.link.keeps_time:
            return 0.0
        return time.monotonic() - self.clock.estimate_s(self.unwrap_t_us(t_us))

    def unwrap_t_us(self, t_us: int) -> int:
        """A message's 32-bit device time on the same axis as the batches' ``t_us``."""
        return self._decoder.unwrap_t_us(t_us)


def thin(batch: Batch, every: int) -> Batch:
    """The batch with only the frames at multiples of ``every`` in seq; everything else stays."""
    if not len(batch.wire):
        return batch
    kept = batch.seq % every == 0
    frames = batch.wire[kept]
    fingers = sum({1 << finger for finger in (*frames["finger"].tolist(), *batch.idle["finger"].tolist())})
    return replace(batch, wire=frames, seq=batch.seq[kept], t_us=batch.t_us[kept], fingers=fingers)


def _decoder(hello: wire.Hello, messages: Mapping[int, type[Any]]) -> StreamDecoder:
    decoder = StreamDecoder(messages)
    if hello.wire_minor > wire.WIRE_MINOR:
        decoder.accept_newer_minor()
    return decoder
