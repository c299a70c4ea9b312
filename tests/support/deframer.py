"""The link's framing in plain Python over `cobs` and `zlib`: the model for host/binding/decode/decode.c, and the
framing of a scripted board.
"""

import zlib

from cobs import cobs

from biotac.wire import messages_gen as wire
from biotac.wire.framing import FramingCounts

CRC_BYTES = 4
ENCODED_MAX_BYTES = wire.MAX_FRAME_BYTES + 1  # COBS adds exactly one byte to frames this short


def encode(message_id: int, payload: bytes) -> bytes:
    """Return one whole frame with the delimiter; payload is at most 249 bytes."""
    plain = bytes([message_id]) + payload
    return bytes(cobs.encode(plain + zlib.crc32(plain).to_bytes(CRC_BYTES, "little"))) + b"\0"


class Deframer:
    """Splits a byte stream into checked messages; any chunking gives the same result.

    ``allow_longer`` accepts payloads longer than this library knows, for a peer of a newer wire minor: fields
    are append-only, so the known ones are at the front.
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
        # Never hoard bytes that cannot become a frame: a silent delimiter would grow this without bound.
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
