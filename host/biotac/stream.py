"""From checked messages to arrays, with sequence numbers and device time unwrapped and losses counted.

No I/O: the live link, the recorder's reader and the tests all feed the same class.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _wire as wire
from .decode import STREAMED, Buffer, Decoded, Decoder
from .frames import IDLE_DTYPE, PAC_DTYPE, StructArray, frames_from_wire
from .framing import FramingCounts
from .numbering import Numbering, Unwrapper


@dataclass
class Batch:
    """What one chunk of bytes completed.

    ``wire`` holds the FRAME messages as sent (wire.DTYPES), ``seq`` and ``t_us`` (int64) their unwrapped
    numbers and device times, ``frames`` the same rows in user units, converted when first asked for;
    ``pac`` is PAC_DTYPE, ``idle`` IDLE_DTYPE; ``messages`` is everything else, in order.
    """

    wire: StructArray
    seq: NDArray[np.int64]
    t_us: NDArray[np.int64]
    pac: StructArray
    idle: StructArray
    messages: list[Any] = field(default_factory=list)

    @cached_property
    def frames(self) -> StructArray:
        """The FRAMEs in user units, FRAME_DTYPE (n,)."""
        return frames_from_wire(self.wire, self.seq, self.t_us)

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
    """Health of the link as this side sees it."""

    bytes_received: int
    frames: int
    frames_lost: int
    pac_lost: int
    disordered: int  # sequence numbers that repeat or step back, as after a reboot
    crc_errors: int
    other_errors: int
    batches_skipped: int = 0  # came, and were let go for a consumer that was too slow
    frames_skipped: int = 0
    gaps: int = 0  # times in which the board was away


class StreamDecoder:
    """Chunks of bytes in, batches of arrays out; what is lost is known by the sequence numbers."""

    def __init__(self) -> None:
        self._decoder = Decoder()
        self._rounds = Numbering()  # FRAMEs and IDLEs share one numbering: together they account for every round
        self._pacs = Numbering()
        self._time = Unwrapper(32)  # one clock for all: a finger plugged in late is not early

    @property
    def lost(self) -> int:
        """Frames that were made and never came."""
        return self._rounds.lost

    @property
    def lost_pac(self) -> int:
        """PAC blocks that were made and never came."""
        return self._pacs.lost

    @property
    def disordered(self) -> int:
        """Numbers that repeat or step back, as after a reboot."""
        return self._rounds.disordered + self._pacs.disordered

    @property
    def lost_after(self) -> list[tuple[int, int, int]]:
        """(finger, seq before the gap, frames lost) of every gap so far."""
        return self._rounds.gaps

    @property
    def counts(self) -> FramingCounts:
        """What became of the bytes so far."""
        return self._decoder.counts

    def stats(self, bytes_received: int, frames: int) -> LinkStats:
        """All counts, with what the caller has counted."""
        counts = self.counts
        return LinkStats(
            bytes_received=bytes_received,
            frames=frames,
            frames_lost=self.lost,
            pac_lost=self.lost_pac,
            disordered=self.disordered,
            crc_errors=counts.bad_crc,
            other_errors=counts.bad - counts.bad_crc,
        )

    def accept_newer_minor(self) -> None:
        """The peer's wire minor is newer: its messages may be longer than known here."""
        self._decoder.allow_longer = True

    def unwrap_t_us(self, t_us: int) -> int:
        """A message's 32-bit device time on the same axis as the batches' ``t_us``."""
        return int(self._time.extend(np.array([t_us]))[0])

    def feed(self, chunk: Buffer) -> Batch:
        """Take any number of bytes; return what they complete."""
        decoded = self._decoder.feed(chunk)
        if not decoded.others:
            return self._convert(decoded)
        parts: list[Batch] = []
        for piece in split_at_starts(decoded):
            if parts:
                # What the board made before it was asked to stream was never sent: no loss.
                self._rounds.rejoin()
                self._pacs.rejoin()
            parts.append(self._convert(piece))
        return parts[0] if len(parts) == 1 else join(parts)

    def _convert(self, decoded: Decoded) -> Batch:
        frames, idles, pacs = decoded.frames, decoded.idles, decoded.pacs
        n = len(frames)
        if len(idles):
            order = np.argsort(np.concatenate([decoded.order(wire.Frame.ID), decoded.order(wire.Idle.ID)]))
            finger, seq, t_us = (np.concatenate([frames[k], idles[k]])[order] for k in ("finger", "seq", "t_us"))
            rounds = np.concatenate([np.ones(n, np.int64), idles["frames"]])[order]
            numbers, times = np.empty((2, len(order)), np.int64)
            numbers[order] = self._rounds.extend(finger, seq, rounds)
            times[order] = self._time.extend(t_us)
        else:
            numbers = self._rounds.extend(frames["finger"], frames["seq"], 1)
            times = self._time.extend(frames["t_us"])
        idle = np.empty(len(idles), IDLE_DTYPE)
        if len(idles):
            idle["seq"], idle["t_us"] = numbers[n:], times[n:]
            for name in ("finger", "frames", "energy_count2", "pdc", "tdc", "flags"):
                idle[name] = idles[name]
        pac = np.empty(len(pacs), PAC_DTYPE)
        if len(pacs):
            pac["finger"], pac["pac"] = pacs["finger"], pacs["pac"]
            pac["seq"] = self._pacs.extend(pacs["finger"], pacs["seq"], 1)
            pac["t_us"] = self._time.extend(pacs["t_us"])
        return Batch(frames, numbers[:n], times[:n], pac, idle, known(decoded.others))


def known(others: list[tuple[int, bytes]]) -> list[Any]:
    """Messages of known ids; the others are a newer peer's."""
    return [wire.MESSAGES[message_id].unpack(payload) for message_id, payload in others if message_id in wire.MESSAGES]


def split_at_starts(decoded: Decoded) -> list[Decoded]:
    """In pieces, each but the last with the board's yes to a START as its last message."""
    starts = [k for k, other in enumerate(decoded.others) if is_start(*other)]
    if not starts:
        return [decoded]
    others_at = [at for at, message_id in enumerate(decoded.ids) if message_id not in STREAMED]
    ends = [others_at[k] + 1 for k in starts]
    return [decoded.between(begin, end) for begin, end in zip([0, *ends], [*ends, len(decoded.ids)], strict=True)]


def is_start(message_id: int, payload: bytes) -> bool:
    """The board's yes to START."""
    if message_id != wire.Reply.ID:
        return False
    reply = wire.Reply.unpack(payload)
    return reply.command == wire.Start.ID and reply.error == wire.Error.OK


def split(batch: Batch, end_us: int) -> tuple[Batch, Batch]:
    """Rows before device time ``end_us``, and the rest."""
    now = batch.t_us < end_us
    pac_now = batch.pac["t_us"] < end_us
    idle_now = batch.idle["t_us"] < end_us

    def rows(mine: Any, pac: Any, idle: Any, messages: list[Any]) -> Batch:
        return Batch(batch.wire[mine], batch.seq[mine], batch.t_us[mine], batch.pac[pac], batch.idle[idle], messages)

    return rows(now, pac_now, idle_now, batch.messages), rows(~now, ~pac_now, ~idle_now, [])


def join(batches: list[Batch]) -> Batch:
    """One batch of all rows, in order."""
    if not batches:
        return StreamDecoder().feed(b"")
    return Batch(
        np.concatenate([b.wire for b in batches]),
        np.concatenate([b.seq for b in batches]),
        np.concatenate([b.t_us for b in batches]),
        np.concatenate([b.pac for b in batches]),
        np.concatenate([b.idle for b in batches]),
        [m for b in batches for m in b.messages],
    )
