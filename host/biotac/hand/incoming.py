"""What a board sends, as it arrives: bytes from a link become batches, and are recorded, counted and timed."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

from ..clock import LAST_SAMPLE_US, Arrivals, DeviceClock
from ..link import Link
from ..wire import messages_gen as wire
from ..wire.batches import Batch, LinkStats, StreamDecoder
from .gap import Gap

UNANSWERED = 8  # how many unanswered questions for the time are remembered


class Incoming:
    """What the board on ``link`` sends after its ``hello``; only one thread at a time may read.

    ``deliver`` is called with every batch that is not empty, on the thread that reads.
    """

    def __init__(self, link: Link, hello: wire.Hello, deliver: Callable[[Batch], object]) -> None:
        #: Converts device time to host time, fed by whatever is read; known after the first STATUS that was asked for.
        self.clock = DeviceClock(unix_offset_s=time.time() - time.monotonic())
        #: Called with all bytes as they arrive, and with b"" when none came in time. Its OSError ends it, not reading.
        self.record: Callable[[bytes], object] | None = None
        #: Called with a gap, before the first batch after it is delivered.
        self.record_gap: Callable[[Gap], object] = lambda gap: None
        self.trouble: Exception | None = None  #: the error that ended a recording, until it is raised to a caller
        self.gap: Gap | None = None  #: to be delivered with the next rows
        self._link = link
        self._deliver = deliver
        self._decoder = _decoder(hello)
        self._past: list[LinkStats] = []  # of decoders before a reboot
        self._gaps = self._bytes = self._frames = 0
        self._arrivals = Arrivals(self.clock)
        self._time_asked: dict[int, float] = {}  # by req_id: when each request without an answer yet was sent

    @property
    def stats(self) -> LinkStats:
        """Counts since the handshake, over reboots too."""
        now = self._decoder.stats(self._bytes, self._frames)
        lost = {
            name: sum(getattr(stats, name) for stats in (*self._past, now))
            for name in ("frames_lost", "pac_lost", "disordered", "crc_errors", "other_errors")
        }
        return replace(now, gaps=self._gaps, **lost)

    def restarted(self, hello: wire.Hello) -> None:
        """Start over with a board that restarted: its sequence numbers and its time begin anew."""
        self._past.append(self._decoder.stats(0, 0))
        self._decoder = _decoder(hello)
        self.clock.restart()
        self._arrivals.forget()

    def read(self, timeout_s: float) -> Batch | bytes | None:
        """Read the link once: what arrived within timeout_s, for ``take``. Raises what the link raises."""
        fd = self._link.fd
        return self._link.read(timeout_s) if fd is None else self._decoder.read(fd, timeout_s)

    def take(self, came: Batch | bytes | None) -> bool:
        """Record, count and deliver what ``read`` returned; false when that was nothing."""
        decoder = self._decoder
        if isinstance(came, Batch):
            if self.record is not None:
                self._record(decoder.chunk())
            self._arrived(came)
            return True
        if self.record is not None:
            self._record(came or b"")
        if not came:
            return False
        self._arrived(decoder.feed(came, time.monotonic()))
        return True

    def end_packet(self) -> None:
        """End a packet that was cut off halfway, here and in a recording: the rest of it will not come."""
        self.take(b"\0")

    def _record(self, chunk: bytes) -> None:
        assert self.record is not None
        try:
            self.record(chunk)
        except OSError as error:
            self.record, self.trouble = None, error

    def _arrived(self, batch: Batch) -> None:
        decoder = self._decoder
        self._bytes += decoder.taken
        last_us = decoder.last_t_us
        if last_us is not None:
            self._arrivals.note(last_us + LAST_SAMPLE_US, batch.arrived_s)
            self._frames += len(batch.wire)
        elif not (len(batch.pac) or batch.messages):
            return
        if self.gap is not None:
            self._end_gap(self.gap, batch)
        if self._time_asked and batch.messages:
            self._time_told(batch)
        self._deliver(batch)

    def _end_gap(self, gap: Gap, batch: Batch) -> None:
        first_us = batch.first_t_us()
        if first_us is None:
            return
        gap = replace(gap, next_t_us=first_us)
        self.gap = None
        self._gaps += 1
        batch.messages.insert(0, gap)
        self.record_gap(gap)

    # ---- its time ------------------------------------------------------------------------------

    def time_asked(self, req_id: int) -> None:
        """Note that a GET_STATUS with this number is about to be sent: its answer goes only to ``clock``."""
        if len(self._time_asked) >= UNANSWERED:
            self._time_asked = {}  # the board does not answer, or it restarted
        self._time_asked[req_id] = time.monotonic()

    def _time_told(self, batch: Batch) -> None:
        for answer in [m for m in batch.messages if isinstance(m, wire.Status) and m.req_id in self._time_asked]:
            sent_s = self._time_asked.pop(answer.req_id)
            batch.messages.remove(answer)
            self.round_trip(answer, sent_s, max(sent_s, batch.arrived_s))

    def round_trip(self, answer: wire.Status, sent_s: float, arrived_s: float) -> None:
        """Feed ``clock``: ``answer`` was made between these two times of time.monotonic()."""
        self.clock.round_trip(sent_s, self._decoder.unwrap_t_us(answer.t_us), arrived_s)


def _decoder(hello: wire.Hello) -> StreamDecoder:
    decoder = StreamDecoder()
    if hello.wire_minor > wire.WIRE_MINOR:
        decoder.accept_newer_minor()
    return decoder
