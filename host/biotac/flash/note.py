"""The note in an image that identifies it (firmware/app/image_note.h): read for flashing, written by the build.

Uses only the standard library: tools/image/note.py loads this file where the package is not installed.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass

MAGIC = b"BIOTAC image"
LAYOUT = 2
FIELDS = struct.Struct("<12sHH3BBB3x")
PROOF = struct.Struct("<II")  # after FIELDS: the image's size in bytes and its CRC-32
CRC_AT = FIELDS.size + 4
CRC_BYTES = 4
ALIGNMENT = 4


@dataclass(frozen=True)
class Note:
    """The board (wire.BoardKind) that an image is for, and the fields of its HELLO."""

    board: int
    firmware: tuple[int, int, int]
    wire: tuple[int, int]
    crc32: int

    @property
    def version(self) -> str:
        return ".".join(map(str, self.firmware))


def find(image: bytes) -> Note:
    """The note of an image, which may be followed by zeros.

    Raises ValueError unless there is exactly one note, of this layout, and the image has the size and CRC-32 of it.
    """
    at = _place(image)
    _, layout, board, *numbers = FIELDS.unpack_from(image, at)
    if layout != LAYOUT:
        raise ValueError(f"its note has layout {layout}, this library knows {LAYOUT}: use the image of this release")
    size, crc32 = PROOF.unpack_from(image, at + FIELDS.size)
    if size == 0:
        raise ValueError("its note was never filled in, as in an .elf that the build did not finish: use its .uf2")
    if not at + CRC_AT + CRC_BYTES <= size <= len(image) or any(image[size:]):
        raise ValueError(f"its note says {size} bytes, it has {len(image)}: the file is damaged, get it again")
    seen = _crc32(image[:size], at)
    if seen != crc32:
        raise ValueError(f"its bytes have CRC-32 {seen:08x}, its note says {crc32:08x}: get the file again")
    return Note(board, (numbers[0], numbers[1], numbers[2]), (numbers[3], numbers[4]), crc32)


def seal(image: bytes) -> bytes:
    """The image with size and CRC-32 filled into the note. Raises ValueError unless there is exactly one note."""
    at = _place(image)
    sized = bytearray(image)
    PROOF.pack_into(sized, at + FIELDS.size, len(image), 0)
    PROOF.pack_into(sized, at + FIELDS.size, len(image), _crc32(bytes(sized), at))
    return bytes(sized)


def bytes_of(image: bytes) -> bytes:
    """The note alone, as it is in the image. Raises ValueError unless there is exactly one."""
    at = _place(image)
    return image[at : at + FIELDS.size + PROOF.size]


def _place(image: bytes) -> int:
    places = range(0, len(image) - FIELDS.size - PROOF.size + 1, ALIGNMENT)
    notes = [at for at in places if image.startswith(MAGIC, at)]
    if len(notes) != 1:
        raise ValueError(f"it says {len(notes)} times which board it is for, expected once; use this gateway's image")
    return notes[0]


def _crc32(image: bytes, note_at: int) -> int:
    """CRC-32 of all bytes, with zeros for the CRC field itself."""
    field = note_at + CRC_AT
    return zlib.crc32(image[field + CRC_BYTES :], zlib.crc32(bytes(CRC_BYTES), zlib.crc32(image[:field])))
