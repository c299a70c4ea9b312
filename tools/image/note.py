#!/usr/bin/env python3
"""Say what an image says of itself (firmware/app/image_note.h): board, firmware, wire.

    note.py IMAGE.bin

Refuses an image without that note, with two of them, or with one of a layout that this tool does not know:
`biotac flash` would refuse it too, but later.
"""

from __future__ import annotations

import struct
import sys
from dataclasses import dataclass
from pathlib import Path

MAGIC = b"BIOTAC image"
LAYOUT = 1
FIELDS = struct.Struct("<12sHH3BBB3x")
ALIGNMENT = 4


@dataclass(frozen=True)
class Note:
    """Which board an image is for, and what it will answer in its HELLO."""

    board: int
    firmware: tuple[int, int, int]
    wire: tuple[int, int]


def read(image: bytes) -> Note:
    """Raises ValueError for an image that has not exactly one note."""
    places = range(0, len(image) - FIELDS.size + 1, ALIGNMENT)
    notes = [at for at in places if image.startswith(MAGIC, at)]
    if len(notes) != 1:
        raise ValueError(f"{len(notes)} image notes; expected one (firmware/app/image_note.h)")
    _, layout, board, *numbers = FIELDS.unpack_from(image, notes[0])
    if layout != LAYOUT:
        raise ValueError(f"an image note of layout {layout}; expected {LAYOUT}")
    return Note(board, (numbers[0], numbers[1], numbers[2]), (numbers[3], numbers[4]))


def main() -> int:
    if len(sys.argv) != 2:
        sys.exit((__doc__ or "").strip())
    try:
        note = read(Path(sys.argv[1]).read_bytes())
    except ValueError as error:
        sys.exit(f"note.py: {error}")
    firmware, wire = (".".join(map(str, numbers)) for numbers in (note.firmware, note.wire))
    print(f"note  board {note.board}, firmware {firmware}, wire {wire}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
