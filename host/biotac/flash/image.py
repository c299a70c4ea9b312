"""Reading a board's UF2 image (https://github.com/microsoft/uf2) and checking that a board can take all of it.

The boot ROM silently skips blocks that it does not accept, so everything that it could skip is an error here.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from ..wire import map_gen as _map
from ..wire.identity import board_text
from ..wire.sensor_gen import MAX_SENSORS
from .note import Note, find

BLOCK_BYTES = 512
HEAD = struct.Struct("<8I")
FIELDS = (
    "magic number", "second magic number", "flags", "address", "size", "number", "count of blocks", "family",
    "last magic number",
)  # fmt: skip
PAGE_BYTES = 256
MAGIC = (0x0A324655, 0x9E5D5157, 0x0AB16F30)
FLAG_FAMILY = 0x2000
FAMILY_RP2040 = 0xE48BFF56

FLASH_AT = 0x10000000
FLASH_BYTES = 2 * 1024 * 1024  # of a Pico
SETTINGS_BYTES = 2 * 4096  # at the flash's end: firmware/core/keep/storage.h
MAPS_BYTES = (2 * MAX_SENSORS + 1) * _map.MAX_BYTES  # before them: firmware/core/map/store.h
BOOT2_BYTES = 252  # followed by its CRC

CARRIED = Path(__file__).with_name("biotac-pico.uf2")  # host/CMakeLists.txt puts it there
BUILT = Path("build/pico/biotac-pico.uf2")  # of a clone


@dataclass(frozen=True)
class Image:
    """A checked UF2 file."""

    path: Path
    blocks: tuple[bytes, ...]
    note: Note

    def boot_last(self) -> tuple[bytes, ...]:
        """The blocks, with that of the second-stage boot last.

        Its sector is erased with the first block written, so the chip has nothing to boot until the very last block:
        after a loss of power the board is in its loader and does not run half an image. The boot ROM takes blocks in
        any order.
        """
        return (*self.blocks[1:], self.blocks[0])


def find_image() -> Path:
    """The image included in this package or, if there is none, the one built in the clone around the working directory.

    Raises InputError when there is neither.
    """
    if CARRIED.is_file():
        return CARRIED
    for folder in (Path.cwd(), *Path.cwd().parents):
        if (folder / BUILT).is_file():
            return folder / BUILT
    raise InputError(
        f"this biotac-gateway was built without a board image, and no {BUILT} is in this folder or above; install a "
        "released wheel, or name an IMAGE, a .uf2 file (to build one, see firmware/boards/pico)"
    )


def read_image(path: Path) -> Image:
    """Read and check an image. Raises InputError saying what is wrong with it."""
    try:
        with path.open("rb") as file:
            data = file.read(8 * FLASH_BYTES + 1)  # more than any board's; in no whole blocks
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); expected an image, .uf2") from error
    try:
        blocks = split(data)
        payload = join_payloads(blocks)
        check_boot2(payload)
        return Image(path, blocks, find(payload))
    except ValueError as error:
        raise InputError(f"{path} cannot be flashed: {error}") from error


def split(data: bytes) -> tuple[bytes, ...]:
    """The blocks of a UF2 file. Raises ValueError for a wrong size."""
    if not data or len(data) % BLOCK_BYTES:
        raise ValueError(
            f"{len(data)} bytes are not a UF2 file, which has blocks of {BLOCK_BYTES}; use the build's .uf2"
        )
    return tuple(data[at : at + BLOCK_BYTES] for at in range(0, len(data), BLOCK_BYTES))


def join_payloads(blocks: tuple[bytes, ...]) -> bytes:
    """The flash's contents from its first byte on. Raises ValueError for a block that the boot ROM would not write.

    Blocks follow one another without gaps, so each one's head is known beforehand. A gap would be legal UF2, but
    RP2040-E14 makes the boot ROM erase sectors wrongly around it.
    """
    end = FLASH_AT + FLASH_BYTES - SETTINGS_BYTES - MAPS_BYTES
    if FLASH_AT + len(blocks) * PAGE_BYTES > end:
        raise ValueError(
            f"its {len(blocks)} blocks reach 0x{end:08X}, where maps and settings begin; use a smaller image"
        )
    pages = []
    for k, block in enumerate(blocks):
        page = (FLASH_AT + k * PAGE_BYTES, PAGE_BYTES, k, len(blocks))
        expected = (*MAGIC[:2], FLAG_FAMILY, *page, FAMILY_RP2040, MAGIC[2])
        seen = (*HEAD.unpack_from(block), *struct.unpack_from("<I", block, BLOCK_BYTES - 4))
        for name, has, wanted in zip(FIELDS, seen, expected, strict=True):
            if has != wanted:
                raise ValueError(
                    f"block {k} of {len(blocks)} has {name} 0x{has:X}, expected 0x{wanted:X}: use the whole .uf2 file "
                    "of a Pico's build"
                )
        if any(block[HEAD.size + PAGE_BYTES : -4]):
            raise ValueError(f"block {k} has data after its {PAGE_BYTES} bytes: the file is damaged, get it again")
        pages.append(block[HEAD.size : HEAD.size + PAGE_BYTES])
    return b"".join(pages)


def check_boot2(payload: bytes) -> None:
    """Raise ValueError unless the right CRC follows the second-stage boot (RP2040 data sheet 2.8.1.3.1).

    The chip does not start an image without it.
    """
    crc = 0xFFFFFFFF
    for byte in payload[:BOOT2_BYTES]:
        crc ^= byte << 24
        for _ in range(8):
            crc = (crc << 1 ^ (0x04C11DB7 if crc & 0x80000000 else 0)) & 0xFFFFFFFF
    stored = int.from_bytes(payload[BOOT2_BYTES : BOOT2_BYTES + 4], "little")
    if crc != stored:
        raise ValueError(
            f"its second-stage boot has CRC 0x{stored:08X}; the chip expects 0x{crc:08X}: use the build's .uf2"
        )


def note_text(note: Note) -> str:
    return f"{board_text(note.board)}, firmware {note.version}, wire {'.'.join(map(str, note.wire))}"
