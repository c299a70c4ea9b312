"""The families of chips with UF2 images: how a file names them, their drive, and their boot ROM's checks.

Uses only the standard library: tools/image/uf2.py loads this file where the package is not installed.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from dataclasses import dataclass

FLASH_AT = 0x10000000
BOOT2_BYTES = 252  # followed by the CRC

# IMAGE_DEF, RP2350 data sheet 5.9: a block between two markers, of items and a link to the next block.
BLOCK_WITHIN = 4096
BLOCK_START, BLOCK_END = 0xFFFFDED3, 0xAB123579
IMAGE_TYPE, LAST_ITEM = 0x42, 0xFF
EXE_ARM_SECURE_RP2350 = 0x1021
RAM = range(0x20000000, 0x20082001)  # where a stack may begin
ENTRY_WITHIN = 64 * 1024


@dataclass(frozen=True)
class Family:
    chip: str
    id: int  #: of UF2
    drive: str  #: the drive's label, and the Board-ID in INFO_UF2.TXT
    board: str  #: that a shop sells with it
    flash_bytes: int
    check: Callable[[bytes], None]  #: raises ValueError for an image that the boot ROM would not start


def check_boot2(image: bytes) -> None:
    """The right CRC follows the second-stage boot (RP2040 data sheet 2.8.1.3.1)."""
    crc = 0xFFFFFFFF
    for byte in image[:BOOT2_BYTES]:
        crc ^= byte << 24
        for _ in range(8):
            crc = (crc << 1 ^ (0x04C11DB7 if crc & 0x80000000 else 0)) & 0xFFFFFFFF
    stored = int.from_bytes(image[BOOT2_BYTES : BOOT2_BYTES + 4], "little")
    if crc != stored:
        raise ValueError(
            f"its second-stage boot has CRC 0x{stored:08X}; the chip expects 0x{crc:08X}: use the build's .uf2"
        )


def check_image_def(image: bytes) -> None:
    """One whole IMAGE_DEF for this chip is where the ROM looks, and the vector table leads into the image."""
    words = [word for (word,) in struct.iter_unpack("<I", image[:BLOCK_WITHIN][: len(image) // 4 * 4])]
    starts = [at for at, word in enumerate(words) if word == BLOCK_START]
    if len(starts) != 1:
        raise ValueError(f"it has {len(starts)} IMAGE_DEF blocks in its first 4 KiB, expected 1: use the build's .uf2")
    block = words[starts[0] :][:5]
    expected = [BLOCK_START, EXE_ARM_SECURE_RP2350 << 16 | 1 << 8 | IMAGE_TYPE, 1 << 8 | LAST_ITEM, 0, BLOCK_END]
    if block != expected:
        seen, wanted = (" ".join(f"{word:08X}" for word in some) for some in (block, expected))
        raise ValueError(f"its IMAGE_DEF is {seen}; the chip expects {wanted}: use the build's .uf2")
    stack, entry = words[0], words[1]
    if stack not in RAM or stack % 8 or not entry & 1 or entry not in range(FLASH_AT, FLASH_AT + ENTRY_WITHIN):
        raise ValueError(f"its vectors begin with 0x{stack:08X} 0x{entry:08X}, no stack in RAM and code in flash")


RP2040 = Family("RP2040", 0xE48BFF56, "RPI-RP2", "Pico", 2 << 20, check_boot2)
RP2350 = Family("RP2350", 0xE48BFF59, "RP2350", "Pico 2", 4 << 20, check_image_def)
FAMILIES = (RP2040, RP2350)
