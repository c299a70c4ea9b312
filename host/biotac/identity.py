"""What a board says of itself, as text."""

from __future__ import annotations

from . import _wire as wire


def board_text(board: int) -> str:
    """A board's name, or its number when it is newer than this library."""
    return wire.Board(board).name if board in list(wire.Board) else f"board {board}"


def version_text(hello: wire.Hello) -> str:
    """Firmware release."""
    return f"{hello.firmware_major}.{hello.firmware_minor}.{hello.firmware_patch}"


def serial_text(hello: wire.Hello) -> str:
    """The board's unique id: as text where it is text, else in hex."""
    raw = bytes(hello.board_serial).rstrip(b"\0")
    return raw.decode() if raw and all(0x20 <= b < 0x7F for b in raw) else bytes(hello.board_serial).hex()
