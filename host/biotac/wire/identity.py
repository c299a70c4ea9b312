"""What boards and sensors say of themselves, as text."""

from __future__ import annotations

from collections.abc import Iterable

from . import messages_gen as wire

# What HELLO says where there is no image, or one from before it said so.
NO_IMAGE = 0xFFFFFFFF

# A Pico's number has 8 bytes; HELLO leaves room for 12 and fills up with zeros.
SERIAL_BYTES = 8


def board_text(board: int) -> str:
    """A board's name, or its number when it is newer than this library."""
    return wire.Board(board).name if board in list(wire.Board) else f"board {board}"


def version_text(hello: wire.Hello) -> str:
    """Firmware release."""
    return f"{hello.firmware_major}.{hello.firmware_minor}.{hello.firmware_patch}"


def serial_text(hello: wire.Hello) -> str:
    """The board's unique number as USB tells it: as text where it is text, else in hex."""
    raw = bytes(hello.board_serial)
    text = raw.rstrip(b"\0")
    if text and all(0x20 <= b < 0x7F for b in text):
        return text.decode()
    return raw[: max(len(text), SERIAL_BYTES)].hex().upper()


def ascii_text(values: Iterable[int]) -> str:
    """A sensor's zero-padded ASCII, such as its serial number; what is none, or would move a terminal, as U+FFFD."""
    text = bytes(values).rstrip(b"\0").decode("ascii", errors="replace")
    return "".join(c if c.isprintable() else "\ufffd" for c in text)
