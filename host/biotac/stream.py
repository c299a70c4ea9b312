"""From checked messages to arrays, with sequence numbers and device time unwrapped and losses counted.

No I/O: the live link, the recorder's reader and the tests all feed the same class.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _wire as wire
from .frames import FRAME_DTYPE, IDLE_DTYPE, PAC_DTYPE, StructArray, frames_from_wire
from .framing import Deframer, FramingCounts

STREAMED = (wire.Frame.ID, wire.Pac.ID, wire.Idle.ID)

# What numbers a stream: a row stands for `rounds` rounds, of which `seq` is the last.
ROUND_DTYPE = np.dtype([("finger", "u1"), ("seq", "<u2"), ("t_us", "<u4"), ("rounds", "<u2")])


@dataclass
class Batch:
    """What one chunk of bytes completed.

    ``wire`` holds the FRAME messages as sent (wire.DTYPES), ``frames`` the same rows in user units;
    ``pac`` is PAC_DTYPE, ``idle`` IDLE_DTYPE; ``messages`` is everything else, in order.
    """

    wire: StructArray
    frames: StructArray
    pac: StructArray
    idle: StructArray
    messages: list[Any] = field(default_factory=list)

    def last_t_us(self) -> int | None:
        """Device time of the latest frame or heartbeat; None without any."""
        ends = [int(rows["t_us"].max()) for rows in (self.frames, self.idle) if len(rows)]
        return max(ends, default=None)

    def first_t_us(self) -> int | None:
        """Device time of the earliest frame or heartbeat; None without any."""
        begins = [int(rows["t_us"].min()) for rows in (self.frames, self.idle) if len(rows)]
        return min(begins, default=None)


class Unwrapper:
    """Extends a wrapping counter to int64, each value to the nearest after the one before."""

    def __init__(self, bits: int) -> None:
        self._modulus = 1 << bits
        self._last: int | None = None

    def extend(self, values: NDArray[Any]) -> NDArray[np.int64]:
        """Return the unwrapped values; steps back stay steps back."""
        raw = values.astype(np.int64)
        if not len(raw):
            return raw
        first = int(raw[0]) if self._last is None else self._last
        half = self._modulus // 2
        steps = (np.diff(raw, prepend=first % self._modulus) + half) % self._modulus - half
        out: NDArray[np.int64] = first + np.cumsum(steps)
        self._last = int(out[-1])
        return out


@dataclass(frozen=True)
class LinkStats:
    """Health of the link as this side sees it."""

    bytes_received: int
    frames: int
    frames_lost: int
    pac_lost: int
    disordered: int  # sequence numbers that repeat or step back, as after a reboot
    crc_errors: int
    other_errors: int


class StreamDecoder:
    """Chunks of bytes in, batches of arrays out.

    ``lost`` counts the frames, ``lost_pac`` the PAC blocks, that the sequence numbers say were made
    but never came; ``disordered`` counts numbers that repeat or step back, as after a reboot.
    """

    def __init__(self) -> None:
        self._deframer = Deframer()
        self._seq: dict[tuple[int, int], Unwrapper] = defaultdict(lambda: Unwrapper(16))
        self._time = Unwrapper(32)  # one clock for all: a finger plugged in late is not early
        self._next_seq: dict[tuple[int, int], int] = {}
        self.lost = 0
        self.lost_pac = 0
        self.disordered = 0
        self.lost_after: list[tuple[int, int, int]] = []  # finger, seq before the gap, frames lost

    @property
    def counts(self) -> FramingCounts:
        """What became of the bytes so far."""
        return self._deframer.counts

    def stats(self, bytes_received: int, frames: int) -> LinkStats:
        """All counts, with what the caller has counted."""
        return LinkStats(
            bytes_received=bytes_received,
            frames=frames,
            frames_lost=self.lost,
            pac_lost=self.lost_pac,
            disordered=self.disordered,
            crc_errors=self.counts.bad_crc,
            other_errors=self.counts.bad - self.counts.bad_crc,
        )

    def accept_newer_minor(self) -> None:
        """The peer's wire minor is newer: its messages may be longer than known here."""
        self._deframer.allow_longer = True

    def unwrap_t_us(self, t_us: int) -> int:
        """A message's 32-bit device time on the same axis as the batches' ``t_us``."""
        return int(self._time.extend(np.array([t_us]))[0])

    def feed(self, chunk: bytes) -> Batch:
        """Take any number of bytes; return what they complete."""
        streamed = Arrivals()
        others: list[Any] = []
        parts: list[Batch] = []
        for message_id, payload in self._deframer.feed(chunk):
            if message_id in STREAMED:
                streamed.add(message_id, payload)
            elif message_id in wire.MESSAGES:
                others.append(wire.MESSAGES[message_id].unpack(payload))
                if is_start(others[-1]):
                    # What the board made before it was asked to stream was never sent: no loss.
                    parts.append(self._convert(streamed, others))
                    streamed, others = Arrivals(), []
                    self._next_seq.clear()
        return join([*parts, self._convert(streamed, others)]) if parts else self._convert(streamed, others)

    def _convert(self, streamed: Arrivals, others: list[Any]) -> Batch:
        frame_wire, idle_wire, pac_wire = (streamed.rows(m) for m in (wire.Frame.ID, wire.Idle.ID, wire.Pac.ID))
        n = len(frame_wire)
        # FRAMEs and IDLEs share one numbering: together they account for every round.
        both = np.concatenate([numbered(frame_wire, 1), numbered(idle_wire, idle_wire["frames"])])
        order = np.argsort(streamed.order(wire.Frame.ID) + streamed.order(wire.Idle.ID))
        seq, t_us = np.empty((2, len(both)), np.int64)
        seq[order], t_us[order] = self._extend(wire.Frame.ID, both[order])
        frames = frames_from_wire(frame_wire, seq[:n], t_us[:n])
        idle = np.empty(len(idle_wire), IDLE_DTYPE)
        idle["seq"], idle["t_us"] = seq[n:], t_us[n:]
        for name in ("finger", "frames", "energy_count2", "pdc", "tdc", "flags"):
            idle[name] = idle_wire[name]
        pac = np.empty(len(pac_wire), PAC_DTYPE)
        pac["seq"], pac["t_us"] = self._extend(wire.Pac.ID, numbered(pac_wire, 1))
        pac["finger"] = pac_wire["finger"]
        pac["pac"] = pac_wire["pac"]
        return Batch(frame_wire, frames, pac, idle, others)

    def _extend(self, message_id: int, rows: StructArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        seq = np.zeros(len(rows), np.int64)
        for finger in np.unique(rows["finger"]):
            mine = rows["finger"] == finger
            key = (message_id, int(finger))
            seq[mine] = self._seq[key].extend(rows["seq"][mine])
            self._count_gaps(key, seq[mine], rows["rounds"][mine])
        return seq, self._time.extend(rows["t_us"])

    def _count_gaps(self, key: tuple[int, int], seq: NDArray[np.int64], rounds: NDArray[Any]) -> None:
        first = seq - rounds.astype(np.int64) + 1
        expected = np.concatenate(([self._next_seq.get(key, int(first[0]))], seq[:-1] + 1))
        gaps = first - expected
        self.disordered += int(np.count_nonzero(gaps < 0))
        for at in np.flatnonzero(gaps > 0):
            if key[0] == wire.Pac.ID:
                self.lost_pac += int(gaps[at])
            else:
                self.lost += int(gaps[at])
                self.lost_after.append((key[1], int(expected[at]) - 1, int(gaps[at])))
        self._next_seq[key] = int(seq[-1]) + 1


class Arrivals:
    """Payloads by message id, with the order in which they came."""

    def __init__(self) -> None:
        self._payloads: dict[int, list[bytes]] = {message_id: [] for message_id in STREAMED}
        self._order: dict[int, list[int]] = {message_id: [] for message_id in STREAMED}
        self._count = 0

    def add(self, message_id: int, payload: bytes) -> None:
        """Take the next one."""
        self._payloads[message_id].append(payload)
        self._order[message_id].append(self._count)
        self._count += 1

    def rows(self, message_id: int) -> StructArray:
        """All of one id as an array of wire.DTYPES."""
        return np.frombuffer(b"".join(self._payloads[message_id]), wire.DTYPES[message_id])

    def order(self, message_id: int) -> list[int]:
        """When each came."""
        return self._order[message_id]


def numbered(messages: StructArray, rounds: Any) -> StructArray:
    """What ROUND_DTYPE wants of stream messages (n,) that stand for ``rounds`` rounds each."""
    out = np.empty(len(messages), ROUND_DTYPE)
    for name in ("finger", "seq", "t_us"):
        out[name] = messages[name]
    out["rounds"] = rounds
    return out


def is_start(message: Any) -> bool:
    """The board's yes to START."""
    return isinstance(message, wire.Reply) and message.command == wire.Start.ID and message.error == wire.Error.OK


def split(batch: Batch, end_us: int) -> tuple[Batch, Batch]:
    """Rows before device time ``end_us``, and the rest."""
    now = batch.frames["t_us"] < end_us
    pac_now = batch.pac["t_us"] < end_us
    idle_now = batch.idle["t_us"] < end_us
    return (
        Batch(batch.wire[now], batch.frames[now], batch.pac[pac_now], batch.idle[idle_now], batch.messages),
        Batch(batch.wire[~now], batch.frames[~now], batch.pac[~pac_now], batch.idle[~idle_now], []),
    )


def join(batches: list[Batch]) -> Batch:
    """One batch of all rows, in order."""
    if not batches:
        return Batch(
            np.empty(0, wire.DTYPES[wire.Frame.ID]),
            np.empty(0, FRAME_DTYPE),
            np.empty(0, PAC_DTYPE),
            np.empty(0, IDLE_DTYPE),
        )
    return Batch(
        np.concatenate([b.wire for b in batches]),
        np.concatenate([b.frames for b in batches]),
        np.concatenate([b.pac for b in batches]),
        np.concatenate([b.idle for b in batches]),
        [m for b in batches for m in b.messages],
    )
