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
from ..wire.messages_gen import BoardKind
from ..wire.sensor_gen import MAX_SENSORS
from .families import FAMILIES, FLASH_AT, RP2040, RP2350, Family
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
FAMILY_AT = 28  # of a block

SETTINGS_BYTES = 2 * 4096  # at the flash's end: firmware/core/keep/storage.h
MAPS_BYTES = (2 * MAX_SENSORS + 1) * _map.MAX_BYTES  # before them: firmware/core/map/store.h
IMAGE_BYTES_MAX = max(family.flash_bytes for family in FAMILIES)

CARRIED = Path(__file__).parent  # host/CMakeLists.txt puts NAME.uf2 there
BUILT = Path("build")  # of a clone
NAMES = {RP2040: "biotac-pico.uf2", RP2350: "biotac-pico2.uf2"}  # below BUILT, in a folder of their second word
CHIP_OF: dict[int, Family] = {
    BoardKind.PICO: RP2040, BoardKind.PICO_W: RP2040, BoardKind.PICO_SENSOR: RP2040,
    BoardKind.PICO2: RP2350, BoardKind.PICO2_W: RP2350,
}  # fmt: skip


@dataclass(frozen=True)
class Image:
    """A checked UF2 file."""

    path: Path
    blocks: tuple[bytes, ...]
    note: Note
    family: Family = RP2040

    def boot_last(self) -> tuple[bytes, ...]:
        """The blocks, with that of the second-stage boot, or IMAGE_DEF, last.

        That block's sector is erased with the first block written, so the chip has nothing to boot until the very last
        block: after a loss of power the board is in its loader and does not run half an image. The boot ROM accepts
        blocks in any order.
        """
        return (*self.blocks[1:], self.blocks[0])


def find_image(family: Family | None = None) -> Path:
    """The family's image, or any: the one in this package or, without one, in the clone around the working directory.

    Raises InputError when there is neither.
    """
    names = NAMES.values() if family is None else [NAMES[family]]
    for folder in (Path.cwd(), *Path.cwd().parents):
        built = [folder / BUILT / name.removeprefix("biotac-").removesuffix(".uf2") / name for name in names]
        for image in (*(CARRIED / name for name in names), *built):
            if image.is_file():
                return image
    wanted = " or ".join(names)
    raise InputError(
        f"this biotac-gateway was built without a board image, and no {wanted} is below {BUILT} in this folder or "
        "above; install a released wheel, or name an IMAGE, a .uf2 file (to build one, see firmware/boards)"
    )


def read_image(path: Path) -> Image:
    """Read and check an image. Raises InputError that names the fault."""
    try:
        with path.open("rb") as file:
            data = file.read(4 * IMAGE_BYTES_MAX + 1)  # more than any board's; in no whole blocks
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); expected an image, .uf2") from error
    try:
        blocks = split(data)
        family = family_of(blocks[0])
        payload = join_payloads(blocks, family)
        family.check(payload)
        note = find(payload)
        if CHIP_OF.get(note.board, family) is not family:
            raise ValueError(f"it is for a {board_text(note.board)}, and its blocks are an {family.chip}'s")
        return Image(path, blocks, note, family=family)
    except ValueError as error:
        raise InputError(f"{path} cannot be flashed: {error}") from error


def split(data: bytes) -> tuple[bytes, ...]:
    """The blocks of a UF2 file. Raises ValueError for a wrong size."""
    if not data or len(data) % BLOCK_BYTES:
        raise ValueError(
            f"{len(data)} bytes are not a UF2 file, which has blocks of {BLOCK_BYTES}; use the build's .uf2"
        )
    return tuple(data[at : at + BLOCK_BYTES] for at in range(0, len(data), BLOCK_BYTES))


def family_of(block: bytes) -> Family:
    """The family that a block names; RP2040 where it names no known one, so that the other checks name the fault."""
    (number,) = struct.unpack_from("<I", block, FAMILY_AT)
    return next((family for family in FAMILIES if family.id == number), RP2040)


def join_payloads(blocks: tuple[bytes, ...], family: Family) -> bytes:
    """The flash's contents from the first byte on. Raises ValueError for a block that the boot ROM would not write.

    Blocks follow one another without gaps, so each one's head is known beforehand. A gap would be legal UF2, but
    RP2040-E14 makes the boot ROM erase sectors wrongly around it.
    """
    end = FLASH_AT + family.flash_bytes - SETTINGS_BYTES - MAPS_BYTES
    if FLASH_AT + len(blocks) * PAGE_BYTES > end:
        raise ValueError(
            f"its {len(blocks)} blocks reach 0x{end:08X}, where maps and settings begin; use a smaller image"
        )
    pages = []
    for k, block in enumerate(blocks):
        page = (FLASH_AT + k * PAGE_BYTES, PAGE_BYTES, k, len(blocks))
        expected = (*MAGIC[:2], FLAG_FAMILY, *page, family.id, MAGIC[2])
        seen = (*HEAD.unpack_from(block), *struct.unpack_from("<I", block, BLOCK_BYTES - 4))
        for name, has, wanted in zip(FIELDS, seen, expected, strict=True):
            if has != wanted:
                raise ValueError(
                    f"block {k} of {len(blocks)} has {name} 0x{has:X}, expected 0x{wanted:X}: use the whole .uf2 file "
                    f"of a {family.board}'s build"
                )
        if any(block[HEAD.size + PAGE_BYTES : -4]):
            raise ValueError(f"block {k} has data after its {PAGE_BYTES} bytes: the file is damaged, get it again")
        pages.append(block[HEAD.size : HEAD.size + PAGE_BYTES])
    return b"".join(pages)


def note_text(note: Note) -> str:
    return f"{board_text(note.board)}, firmware {note.version}, wire {'.'.join(map(str, note.wire))}"
