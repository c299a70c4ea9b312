"""What an image says of itself: the reader of firmware/app/image_note.h, for flashing and for the build.

Nothing but the standard library: tools/image/note.py loads this file where the package is not installed.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

MAGIC = b"BIOTAC image"
LAYOUT = 1
FIELDS = struct.Struct("<12sHH3BBB3x")
ALIGNMENT = 4


@dataclass(frozen=True)
class Note:
    """Which board (wire.Board) an image is for, and what it will answer in its HELLO."""

    board: int
    firmware: tuple[int, int, int]
    wire: tuple[int, int]

    @property
    def version(self) -> str:
        """Firmware release."""
        return ".".join(map(str, self.firmware))


def find(image: bytes) -> Note:
    """Raises ValueError for an image that has not exactly one note, or one of another layout."""
    places = range(0, len(image) - FIELDS.size + 1, ALIGNMENT)
    notes = [at for at in places if image.startswith(MAGIC, at)]
    if len(notes) != 1:
        raise ValueError(f"it says {len(notes)} times which board it is for; expected once: is it this gateway's?")
    _, layout, board, *numbers = FIELDS.unpack_from(image, notes[0])
    if layout != LAYOUT:
        raise ValueError(f"its note has layout {layout}, this library knows {LAYOUT}; update biotac-gateway")
    return Note(board, (numbers[0], numbers[1], numbers[2]), (numbers[3], numbers[4]))
