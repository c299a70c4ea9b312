"""From messages to the link's bytes: COBS, CRC-32, 0x00 (protocol/SPEC.md). No I/O; decoder.py is the way back.

Both are tested against protocol/vectors/, which the C tests read too.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass

from . import messages_gen as wire
from .native import ffi, lib

CRC_BYTES = 4
OVERHEAD_BYTES = 1 + CRC_BYTES + 1 + 1  # id, CRC, COBS, delimiter
ENCODED_MAX_BYTES = wire.MAX_FRAME_BYTES + 2  # COBS and the delimiter add one each
PAYLOAD_MAX_BYTES = wire.MAX_FRAME_BYTES - 1 - CRC_BYTES


@dataclass
class FramingCounts:
    """The fate of the bytes between two delimiters, as counts."""

    good: int = 0
    too_long: int = 0
    bad_cobs: int = 0
    bad_crc: int = 0
    bad_length: int = 0

    @property
    def bad(self) -> int:
        """How many frames were refused."""
        return self.too_long + self.bad_cobs + self.bad_crc + self.bad_length


def encode(message_id: int, payload: bytes) -> bytes:
    """Return one whole frame with its delimiter. Raises ValueError for a payload of over 249 bytes."""
    if len(payload) > PAYLOAD_MAX_BYTES:
        raise ValueError(f"the payload has {len(payload)} bytes, expected at most {PAYLOAD_MAX_BYTES}")
    out = ffi.new("uint8_t[]", ENCODED_MAX_BYTES)
    return bytes(ffi.buffer(out, lib.bt_frame_encode(message_id, payload, len(payload), out)))


def open_frame(data: bytes) -> tuple[int, bytes] | None:
    """Message id and payload of the bytes between two delimiters; None when they are not a valid frame.

    This is for looking at single frames, whatever their length; streams go through decoder.py.
    """
    out = ffi.new("uint8_t[]", max(1, len(data)))
    n = lib.bt_cobs_decode(data, len(data), out)
    plain = bytes(ffi.buffer(out, max(0, n)))
    covered = plain[:-CRC_BYTES]
    if not covered or zlib.crc32(covered) != int.from_bytes(plain[-CRC_BYTES:], "little"):
        return None
    return covered[0], covered[1:]
