"""The wire of a recording, message by message, with what is needed to write it again."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from ..wire.framing import open_frame


@dataclass(frozen=True)
class Piece:
    """Bytes up to and including a delimiter. ``message_id`` is None where they are not a valid message."""

    block: int
    data: bytes
    message_id: int | None
    payload: bytes


def split(blocks: Iterable[bytes]) -> Iterator[Piece]:
    """All pieces in order; one that continues into the next block belongs to that block.

    Bytes after the last delimiter are left out: they are part of a message that was cut off.
    """
    rest = b""
    for number, block in enumerate(blocks):
        *whole, rest = (rest + block).split(b"\0")
        for data in whole:
            message = open_frame(data)
            yield Piece(number, data + b"\0", *(message or (None, b"")))
