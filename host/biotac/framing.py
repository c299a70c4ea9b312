"""Bytes to messages and back: COBS, CRC-32, 0x00 (protocol/SPEC.md). No I/O in here.

The judge of this module is protocol/vectors/, which the C tests read too.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

from cobs import cobs

from . import _wire as wire

CRC_BYTES = 4
ENCODED_MAX_BYTES = wire.MAX_FRAME_BYTES + 1  # COBS adds exactly one byte to frames this short
OVERHEAD_BYTES = 1 + CRC_BYTES + 1 + 1  # id, CRC, COBS, delimiter


@dataclass
class FramingCounts:
    """What became of the bytes between two delimiters, as counts."""

    good: int = 0
    too_long: int = 0
    bad_cobs: int = 0
    bad_crc: int = 0
    bad_length: int = 0

    @property
    def bad(self) -> int:
        """All refused frames."""
        return self.too_long + self.bad_cobs + self.bad_crc + self.bad_length


def encode(message_id: int, payload: bytes) -> bytes:
    """Return one whole frame with its delimiter; payload is at most 249 bytes."""
    plain = bytes([message_id]) + payload
    return bytes(cobs.encode(plain + zlib.crc32(plain).to_bytes(CRC_BYTES, "little"))) + b"\0"


class Deframer:
    """Splits a byte stream into checked messages; any chunking gives the same result.

    ``allow_longer`` accepts payloads longer than this library knows, for a peer whose wire minor
    is newer: fields are append-only, so the known ones are at the front.
    """

    def __init__(self) -> None:
        self.counts = FramingCounts()
        self.allow_longer = False
        self._rest = b""
        self._overlong = False

    def feed(self, chunk: bytes) -> list[tuple[int, bytes]]:
        """Take any number of bytes; return the (message id, payload) pairs they complete."""
        *pieces, rest = (self._rest + chunk).split(b"\0")
        messages = []
        for piece in pieces:
            message = self._finish(piece)
            if message is not None:
                messages.append(message)
        # Never hoard what cannot become a frame: a silent delimiter would grow this without bound.
        if len(rest) > ENCODED_MAX_BYTES:
            self._overlong = True
            rest = b""
        self._rest = rest
        return messages

    def _finish(self, piece: bytes) -> tuple[int, bytes] | None:
        overlong, self._overlong = self._overlong, False
        if overlong or len(piece) > ENCODED_MAX_BYTES:
            self.counts.too_long += 1
            return None
        if not piece:
            return None
        try:
            plain = cobs.decode(piece)
        except cobs.DecodeError:
            self.counts.bad_cobs += 1
            return None
        covered = plain[:-CRC_BYTES]
        if not covered or zlib.crc32(covered) != int.from_bytes(plain[-CRC_BYTES:], "little"):
            self.counts.bad_crc += 1
            return None
        message_id, payload = covered[0], covered[1:]
        known = wire.MESSAGES.get(message_id)
        if known is not None and len(payload) != known.STRUCT.size:
            if not (self.allow_longer and len(payload) > known.STRUCT.size):
                self.counts.bad_length += 1
                return None
            payload = payload[: known.STRUCT.size]
        self.counts.good += 1
        return message_id, payload
