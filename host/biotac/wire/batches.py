"""From bytes to arrays, with sequence numbers and device times unwrapped and losses counted.

The live link, the reader of recordings and the tests all feed the same class. The work is done in C
(host/binding/decode/intake.c), as is waiting for a port and reading it (descriptor.c next to it).
"""

from __future__ import annotations

import math
import os
import threading
import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import reduce
from operator import or_
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import messages_gen as wire
from .decoder import FRAME, IDLE, NO_FRAME, PAC, STEP_BYTES, Buffer, counts_of, new, pairs
from .frames import IDLE_DTYPE, PAC_DTYPE, StructArray, frames_from_wire, joined
from .framing import FramingCounts
from .native import ffi, lib
from .sensor_gen import SLOT_HZ, SLOTS

# Looked up once: a live link brings few messages at a time, thousands of times a second.
_feed, _feed_packets = lib.bt_intake_feed, lib.bt_intake_feed_packets
_read = lib.bt_intake_read
_frombuffer = np.frombuffer
_NOTHING, _AGAIN = int(lib.BT_DESCRIPTOR_NOTHING), int(lib.BT_DESCRIPTOR_AGAIN)
_HUNG_UP = int(lib.BT_DESCRIPTOR_HUNG_UP)
ROUND_US = 1_000_000 * len(SLOTS) // SLOT_HZ
_WRAP_US = 1 << 32
_UNSURE_US = 1 << 27  # of a silence: the drift of the clocks, and messages under way
_INT64 = np.dtype(np.int64)
_NO_DAMAGE: Mapping[str, int] = {}
_NO_NUMBERS = np.frombuffer(b"", _INT64)
_NO_PAC, _NO_IDLE = (np.frombuffer(b"", dtype) for dtype in (PAC_DTYPE, IDLE_DTYPE))


@dataclass(slots=True)
class Batch:
    """The messages that one chunk of bytes completed.

    ``wire`` holds the FRAME messages as sent (DTYPES); ``seq`` and ``t_us`` (int64) are their unwrapped sequence
    numbers and device times in us. ``frames`` are the same rows in user units, converted on first use. ``pac`` is
    PAC_DTYPE, ``idle`` IDLE_DTYPE; ``messages`` is everything else, in order. ``fingers`` is the bit mask of the
    fingers that may have rows in ``wire`` and ``idle``; -1 where this is unknown. ``arrived_s`` is when the last byte
    came, by time.monotonic(), and ``taken_s`` when the last sample was measured; NaN where unknown, as for a recording.
    ``packets`` are all messages as they came, id, length and payload of each, for recorders, and ``damaged`` counts
    damaged ones, by the names of FramingCounts.
    """

    wire: StructArray
    seq: NDArray[np.int64]
    t_us: NDArray[np.int64]
    pac: StructArray
    idle: StructArray
    messages: list[Any] = field(default_factory=list)
    fingers: int = field(default=-1, repr=False)
    arrived_s: float = math.nan
    taken_s: float = math.nan
    packets: bytes = field(default=b"", repr=False)
    damaged: Mapping[str, int] = field(default_factory=lambda: _NO_DAMAGE, repr=False)
    _frames: StructArray | None = field(default=None, init=False, repr=False, compare=False)

    @property
    def frames(self) -> StructArray:
        """The FRAMEs in user units, FRAME_DTYPE (n,)."""
        if self._frames is None:
            self._frames = frames_from_wire(self.wire, self.seq, self.t_us)
        return self._frames

    @property
    def age_s(self) -> float:
        """The age of the last sample, in s; NaN without rows, and while the board's clock is unknown.

        Only the hand that read the batch can tell: batches that waited while a program stood still are old.
        """
        return time.monotonic() - self.taken_s

    def last_t_us(self) -> int | None:
        """Device time of the latest frame or heartbeat; None without any."""
        ends = [int(t_us.max()) for t_us in (self.t_us, self.idle["t_us"]) if len(t_us)]
        return max(ends, default=None)

    def first_t_us(self) -> int | None:
        """Device time of the earliest frame or heartbeat; None without any."""
        begins = [int(t_us.min()) for t_us in (self.t_us, self.idle["t_us"]) if len(t_us)]
        return min(begins, default=None)


@dataclass(frozen=True)
class LinkStats:
    """Counts that show the health of the link, as seen from this side."""

    bytes_received: int
    frames: int
    frames_lost: int
    pac_lost: int
    disordered: int  # sequence numbers that repeat or step back, as after a reboot
    crc_errors: int
    other_errors: int
    batches_skipped: int = 0  # arrived, but dropped because a consumer was too slow
    frames_skipped: int = 0
    gaps: int = 0  # how many times the board was away
    unknown_messages: int = 0  # of a newer board: omitted here, but in recordings


class StreamDecoder:
    """Chunks of bytes in, batches of arrays out; losses are counted by the sequence numbers."""

    def __init__(self, messages: Mapping[int, type[Any]] = wire.MESSAGES) -> None:
        self._messages = messages
        self._state: Any = new("bt_intake *")
        lib.bt_intake_reset(self._state)
        self._alone = threading.Lock()  # needed because the C code runs without Python's lock
        # Views of the state, which self._state owns.
        self._facts = self._state.facts
        self._out = ffi.buffer(self._state.out)
        self._in = ffi.buffer(getattr(self._state, "in"))
        #: (finger, seq before the gap, frames lost) of every gap so far.
        self.lost_after: list[tuple[int, int, int]] = []
        self.unknown = 0  #: messages of ids that are not known here
        # These are of the last call that returned a batch.
        self.taken = 0  #: how many bytes it took
        self.last_t_us: int | None = None  #: device time of the latest frame or heartbeat
        self._damaged = FramingCounts()
        self._bad = 0

    @property
    def lost(self) -> int:
        """How many frames were made but never arrived."""
        return int(self._state.rounds.lost)

    @property
    def lost_pac(self) -> int:
        """How many PAC blocks were made but never arrived."""
        return int(self._state.pacs.lost)

    @property
    def disordered(self) -> int:
        """How many sequence numbers repeated or stepped back, as after a reboot."""
        return int(self._state.rounds.disordered + self._state.pacs.disordered)

    @property
    def counts(self) -> FramingCounts:
        """The fate of the bytes so far."""
        return counts_of(self._state.decoder)

    def stats(self, bytes_received: int, frames: int) -> LinkStats:
        """All counts, together with those of the caller."""
        counts = self.counts
        return LinkStats(
            bytes_received=bytes_received,
            frames=frames,
            frames_lost=self.lost,
            pac_lost=self.lost_pac,
            disordered=self.disordered,
            crc_errors=counts.bad_crc,
            other_errors=counts.bad - counts.bad_crc,
            unknown_messages=self.unknown,
        )

    def accept_newer_minor(self) -> None:
        """Accept messages that are longer than known here, from a peer with a newer wire minor."""
        self._state.decoder.allow_longer = True

    def passed(self, seconds: float) -> None:
        """Note that no byte came for this long by the host's clock: device time may have wrapped, every 71.6 min.

        Shorter silences need no note, as time goes forward.
        """
        silence_us = int(seconds * 1e6)
        if silence_us > _WRAP_US - _UNSURE_US and self._state.t_us.seen:
            # The next time is then the one nearest to the expected one.
            self.skip_to(int(self._state.t_us.last) + silence_us - _WRAP_US // 2)

    def unwrap_t_us(self, t_us: int) -> int:
        """A message's 32-bit device time on the same axis as the batches' ``t_us``."""
        return int(lib.bt_unwrapped(ffi.addressof(self._state, "t_us"), t_us))

    def feed(self, chunk: Buffer, arrived_s: float = math.nan) -> Batch:
        """Take any number of bytes, which came at ``arrived_s``; return the messages that they complete.

        Raises RuntimeError when another thread is in ``feed``: bytes from two threads have no order.
        """
        if not self._alone.acquire(blocking=False):
            raise RuntimeError("another thread is feeding this decoder; give each thread its own")
        try:
            batch = self._feed(chunk)
            batch.arrived_s = arrived_s
            return batch
        finally:
            self._alone.release()

    def _feed(self, chunk: Buffer) -> Batch:
        size = len(chunk)
        if size <= STEP_BYTES:
            # cffi passes the address of bytes, which is faster than borrowing a buffer.
            _feed(self._state, bytes(chunk), size)
            return self._batch()
        batch = join([self._feed(chunk[at : at + STEP_BYTES]) for at in range(0, size, STEP_BYTES)])
        self.taken, self.last_t_us = size, batch.last_t_us()
        return batch

    def read(self, fd: int, timeout_s: float) -> Batch | None:
        """Wait for bytes from a port and return the Batch, like ``feed``, all in C; other threads run on.

        None when nothing comes within timeout_s. Raises OSError when the port is gone. POSIX only.
        """
        got = _read(self._state, fd, timeout_s)
        if got == _AGAIN:
            # Python's signal handlers run between these lines.
            deadline_s = time.monotonic() + timeout_s
            while got == _AGAIN:
                got = _read(self._state, fd, deadline_s - time.monotonic())
        if got > 0:
            return self._batch()
        if got == _NOTHING:
            return None
        raise OSError("it hung up") if got == _HUNG_UP else OSError(-got, os.strerror(-got))

    def feed_packets(self, packets: bytes) -> Batch:
        """Take packets that were decoded before (Batch.packets). Raises ValueError where one is cut off."""
        batches: list[Batch] = []
        at, view = 0, memoryview(packets)
        while not batches or at < len(packets):
            taken = _feed_packets(self._state, ffi.from_buffer(view[at:]), len(packets) - at)
            if packets and not taken:
                raise ValueError(f"a packet is cut off after {at} of {len(packets)} bytes")
            batches.append(self._batch())
            at += taken
        return batches[0] if len(batches) == 1 else join(batches)

    def begin_at(self, t_us: int | None, rounds: Mapping[int, int], pacs: Mapping[int, int]) -> None:
        """Begin where device time was ``t_us``, with these unwrapped numbers by finger as the next: none are lost."""
        state = self._state
        state.t_us.seen, state.t_us.last = t_us is not None, t_us or 0
        for numbering, numbers in ((state.rounds, rounds), (state.pacs, pacs)):
            lib.bt_numbering_rejoin(ffi.addressof(numbering))
            for finger, number in numbers.items():
                numbering.last[finger], numbering.seen[finger] = number, True
                numbering.unheard[finger] = state.unheard

    def skip_to(self, t_us: int) -> None:
        """Go on from device time ``t_us``: no byte came since the last one, as ``passed`` has found."""
        skip_us = t_us - self._state.t_us.last
        if self._state.t_us.seen and skip_us > 0:
            self._state.t_us.last += skip_us
            self._state.unheard += skip_us // ROUND_US

    @property
    def clock_us(self) -> int | None:
        """Device time of the latest message that has one; None before the first."""
        return int(self._state.t_us.last) if self._state.t_us.seen else None

    def chunk(self) -> bytes:
        """The bytes of the last ``read`` that returned a batch."""
        return bytes(self._in[: self.taken])

    def _batch(self) -> Batch:
        # Copy everything out of the state: the next call overwrites it. The order is that of bt_intake.out: numbers of
        # FRAMEs, PACs and IDLEs, then the rows, then the others.
        facts = self._facts
        self.taken, others = facts.consumed, facts.other_bytes
        n, pacs, idles = facts.rows
        self.last_t_us = facts.last_t_us if n or idles else None
        raw = self._out[: facts.out_bytes]
        if facts.gaps:
            self.lost_after += [(gap.finger, gap.before, gap.missing) for gap in self._state.gaps[0 : facts.gaps]]
        packets = raw[facts.out_bytes - facts.packet_bytes :]
        sent, seq, t_us = NO_FRAME, _NO_NUMBERS, _NO_NUMBERS
        pac, idle, messages = _NO_PAC, _NO_IDLE, []
        at = 16 * (n + pacs + idles)
        if n:
            seq, t_us = _numbers(raw, n, 0)
            sent = _frombuffer(raw, FRAME, n, at)
            at += n * FRAME.itemsize
        if pacs:
            pac = _numbered(_frombuffer(raw, PAC, pacs, at), PAC_DTYPE, *_numbers(raw, pacs, 16 * n))
            at += pacs * PAC.itemsize
        if idles:
            idle = _numbered(_frombuffer(raw, IDLE, idles, at), IDLE_DTYPE, *_numbers(raw, idles, 16 * (n + pacs)))
        if others:
            came = pairs(raw[-others - len(packets) : -len(packets)])
            messages = known(came, self._messages)
            self.unknown += len(came) - len(messages)
        batch = Batch(sent, seq, t_us, pac, idle, messages, facts.fingers, facts.arrived_ns * 1e-9, packets=packets)
        if facts.bad != self._bad:
            before, self._damaged, self._bad = self._damaged, self.counts, facts.bad
            damaged = Counter(vars(self._damaged)) - Counter(vars(before))
            del damaged["good"]
            batch.damaged = damaged
        return batch


def _numbers(raw: bytes, n: int, at: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Unwrapped seq and t_us of ``n`` rows."""
    numbers = _frombuffer(raw, _INT64, 2 * n, at)
    return numbers[:n], numbers[n:]


def _numbered(sent: StructArray, dtype: np.dtype[np.void], seq: NDArray[np.int64], t_us: NDArray[np.int64]) -> Any:
    """Rows of ``dtype`` from messages that have the other fields by name."""
    out = np.empty(len(sent), dtype)
    out["seq"], out["t_us"] = seq, t_us
    for name in dtype.names or ():
        if name not in ("seq", "t_us"):
            out[name] = sent[name]
    return out


def known(others: list[tuple[int, bytes]], messages: Mapping[int, type[Any]] = wire.MESSAGES) -> list[Any]:
    """Those of these ``messages``; the others come from a newer peer and are omitted."""
    return [messages[message_id].unpack(payload) for message_id, payload in others if message_id in messages]


def split(batch: Batch, end_us: int) -> tuple[Batch, Batch]:
    """The rows before device time ``end_us``, with all messages, and the other rows."""
    now, pac_now, idle_now = (t_us < end_us for t_us in (batch.t_us, batch.pac["t_us"], batch.idle["t_us"]))
    whole_us = batch.last_t_us()

    def rows(frames: Any, pac: Any, idle: Any, messages: list[Any]) -> Batch:
        sent, seq, t_us = batch.wire[frames], batch.seq[frames], batch.t_us[frames]
        part = Batch(sent, seq, t_us, batch.pac[pac], batch.idle[idle], messages, batch.fingers, batch.arrived_s)
        last_us = part.last_t_us()
        if last_us is not None and whole_us is not None:
            part.taken_s = batch.taken_s - (whole_us - last_us) * 1e-6
        return part

    return rows(now, pac_now, idle_now, batch.messages), rows(~now, ~pac_now, ~idle_now, [])


def join(batches: list[Batch]) -> Batch:
    """One batch of all rows, in order."""
    if not batches:
        return StreamDecoder().feed(b"")
    names, last = ("wire", "seq", "t_us", "pac", "idle"), batches[-1]
    sent, seq, t_us, pac, idle = (joined([getattr(b, name) for b in batches]) for name in names)
    messages = [m for b in batches for m in b.messages]
    fingers = reduce(or_, (b.fingers for b in batches))
    damaged = sum((Counter(b.damaged) for b in batches), Counter[str]())
    packets = b"".join(b.packets for b in batches)
    return Batch(sent, seq, t_us, pac, idle, messages, fingers, last.arrived_s, last.taken_s, packets, damaged)
