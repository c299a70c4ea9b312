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
from .frames import FRAME_DTYPE, PAC_DTYPE, StructArray, frames_from_wire
from .framing import Deframer, FramingCounts

STREAMED = (wire.Frame.ID, wire.Pac.ID)


@dataclass
class Batch:
    """What one chunk of bytes completed.

    ``wire`` holds the FRAME messages as sent (wire.DTYPES), ``frames`` the same rows in user units;
    ``pac`` is PAC_DTYPE; ``messages`` is everything else, in order.
    """

    wire: StructArray
    frames: StructArray
    pac: StructArray
    messages: list[Any] = field(default_factory=list)


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

    def accept_newer_minor(self) -> None:
        """The peer's wire minor is newer: its messages may be longer than known here."""
        self._deframer.allow_longer = True

    def feed(self, chunk: bytes) -> Batch:
        """Take any number of bytes; return what they complete."""
        streamed: dict[int, list[bytes]] = {message_id: [] for message_id in STREAMED}
        others: list[Any] = []
        parts: list[Batch] = []
        for message_id, payload in self._deframer.feed(chunk):
            if message_id in streamed:
                streamed[message_id].append(payload)
            elif message_id in wire.MESSAGES:
                others.append(wire.MESSAGES[message_id].unpack(payload))
                if is_start(others[-1]):
                    # What the board made before it was asked to stream was never sent: no loss.
                    parts.append(self._convert(streamed, others))
                    streamed, others = {message_id: [] for message_id in STREAMED}, []
                    self._next_seq.clear()
        return join([*parts, self._convert(streamed, others)]) if parts else self._convert(streamed, others)

    def _convert(self, streamed: dict[int, list[bytes]], others: list[Any]) -> Batch:
        frame_wire = np.frombuffer(b"".join(streamed[wire.Frame.ID]), wire.DTYPES[wire.Frame.ID])
        pac_wire = np.frombuffer(b"".join(streamed[wire.Pac.ID]), wire.DTYPES[wire.Pac.ID])
        seq, t_us = self._extend(wire.Frame.ID, frame_wire)
        frames = frames_from_wire(frame_wire, seq, t_us)
        pac = np.empty(len(pac_wire), PAC_DTYPE)
        pac["seq"], pac["t_us"] = self._extend(wire.Pac.ID, pac_wire)
        pac["finger"] = pac_wire["finger"]
        pac["pac"] = pac_wire["pac"]
        return Batch(frame_wire, frames, pac, others)

    def _extend(self, message_id: int, rows: StructArray) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        seq = np.zeros(len(rows), np.int64)
        for finger in np.unique(rows["finger"]):
            mine = rows["finger"] == finger
            key = (message_id, int(finger))
            seq[mine] = self._seq[key].extend(rows["seq"][mine])
            self._count_gaps(key, seq[mine])
        return seq, self._time.extend(rows["t_us"])

    def _count_gaps(self, key: tuple[int, int], seq: NDArray[np.int64]) -> None:
        expected = np.concatenate(([self._next_seq.get(key, int(seq[0]))], seq[:-1] + 1))
        gaps = seq - expected
        self.disordered += int(np.count_nonzero(gaps < 0))
        for at in np.flatnonzero(gaps > 0):
            if key[0] == wire.Pac.ID:
                self.lost_pac += int(gaps[at])
            else:
                self.lost += int(gaps[at])
                self.lost_after.append((key[1], int(expected[at]) - 1, int(gaps[at])))
        self._next_seq[key] = int(seq[-1]) + 1


def is_start(message: Any) -> bool:
    """The board's yes to START."""
    return isinstance(message, wire.Reply) and message.command == wire.Start.ID and message.error == wire.Error.OK


def split(batch: Batch, end_us: int) -> tuple[Batch, Batch]:
    """Rows before device time ``end_us``, and the rest."""
    now = batch.frames["t_us"] < end_us
    pac_now = batch.pac["t_us"] < end_us
    return (
        Batch(batch.wire[now], batch.frames[now], batch.pac[pac_now], batch.messages),
        Batch(batch.wire[~now], batch.frames[~now], batch.pac[~pac_now], []),
    )


def join(batches: list[Batch]) -> Batch:
    """One batch of all rows, in order."""
    if not batches:
        return Batch(np.empty(0, wire.DTYPES[wire.Frame.ID]), np.empty(0, FRAME_DTYPE), np.empty(0, PAC_DTYPE), [])
    return Batch(
        np.concatenate([b.wire for b in batches]),
        np.concatenate([b.frames for b in batches]),
        np.concatenate([b.pac for b in batches]),
        [m for b in batches for m in b.messages],
    )
