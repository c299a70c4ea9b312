"""From the link's bytes to arrays of wire messages, a chunk at a time, in C (host/binding/decode/decode.c). No I/O."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import messages_gen as wire
from .dtypes_gen import DTYPES
from .frames import StructArray, joined
from .framing import FramingCounts
from .native import ffi, lib

Buffer = bytes | bytearray | memoryview

STREAMED = (wire.FrameMessage.ID, wire.Pac.ID, wire.Idle.ID)  # come as rows, in the order of enum bt_decoded

# Looked up once: a few of these look-ups would take as long as a chunk of few messages.
_decode = lib.bt_decode

_unpack = ffi.unpack
_frombuffer = np.frombuffer
FRAME, PAC, IDLE = (DTYPES[message_id] for message_id in STREAMED)
NO_FRAME, NO_PAC, NO_IDLE = (np.frombuffer(b"", dtype) for dtype in (FRAME, PAC, IDLE))
_KINDS = int(lib.BT_DECODED_KINDS)
_ROWS = ("frames", "pacs", "idles")
STEP_BYTES = int(lib.BT_DECODE_BYTES)

# Not cleared, because the reset sets every field that is read: a short connection never touches most of the memory.
new = ffi.new_allocator(should_clear_after_alloc=False)


@dataclass(slots=True)
class Decoded:
    """The messages that one chunk of bytes completed.

    ``frames``, ``pacs`` and ``idles`` are the FRAME, PAC and IDLE messages as sent (DTYPES), each in order of arrival
    and read-only. ``others`` are all others as (message id, payload), including unknown ids. ``packets`` has all of
    them in order of arrival, as id, length, payload, with a newer peer's additions.
    """

    frames: StructArray
    pacs: StructArray
    idles: StructArray
    others: list[tuple[int, bytes]]
    packets: bytes

    def messages(self) -> list[tuple[int, bytes]]:
        """All messages as (message id, payload), in order of arrival."""
        return pairs(self.packets)


class Decoder:
    """Splits a byte stream into checked messages; any chunking gives the same messages.

    A damaged frame is counted and omitted, and so is a known id with a wrong length. Bytes that no delimiter has ended
    yet wait for the next chunk.
    """

    def __init__(self) -> None:
        self._state: Any = new("bt_decoder *")
        lib.bt_decoder_reset(self._state)
        # Views of the state, which self._state owns.
        self._filled = self._state.filled
        self._frames, self._pacs, self._idles, self._others, self._packets = map(ffi.buffer, self._state.data)

    def feed(self, chunk: Buffer) -> Decoded:
        """Take any number of bytes; return the messages that they complete."""
        size = len(chunk)
        if size > STEP_BYTES:
            parts = [self.feed(chunk[at : at + STEP_BYTES]) for at in range(0, size, STEP_BYTES)]
            frames, pacs, idles = (joined([getattr(d, name) for d in parts]) for name in _ROWS)
            others = [other for decoded in parts for other in decoded.others]
            return Decoded(frames, pacs, idles, others, b"".join(decoded.packets for decoded in parts))
        # cffi passes the address of bytes, which is faster than borrowing a buffer. All in one place, because calling
        # functions for the parts would cost a quarter of the time of a chunk of 4096 bytes.
        _decode(self._state, bytes(chunk), size)
        n_frames, n_pacs, n_idles, n_others, n_packets = _unpack(self._filled, _KINDS)
        return Decoded(
            _frombuffer(self._frames[:n_frames], FRAME) if n_frames else NO_FRAME,
            _frombuffer(self._pacs[:n_pacs], PAC) if n_pacs else NO_PAC,
            _frombuffer(self._idles[:n_idles], IDLE) if n_idles else NO_IDLE,
            pairs(self._others[:n_others]) if n_others else [],
            self._packets[:n_packets],
        )

    def accept_newer_minor(self) -> None:
        """As StreamDecoder's. Fields are only ever appended, so the known ones come first; new ones are cut off."""
        self._state.allow_longer = True

    @property
    def counts(self) -> FramingCounts:
        """The fate of the bytes so far."""
        return counts_of(self._state)


def counts_of(decoder: Any) -> FramingCounts:
    """The fate of the bytes that were fed to a C struct bt_decoder."""
    _, *outcomes = decoder.outcomes
    return FramingCounts(*map(int, outcomes))


def pairs(packets: bytes) -> list[tuple[int, bytes]]:
    """The (message id, payload) pairs in bytes of id, length, payload."""
    out = []
    at = 0
    while at < len(packets):
        end = at + 2 + packets[at + 1]
        out.append((packets[at], packets[at + 2 : end]))
        at = end
    return out


def packed(messages: Iterable[tuple[int, bytes]]) -> bytes:
    """Inverse of ``pairs``."""
    return b"".join(bytes((message_id, len(payload))) + payload for message_id, payload in messages)
