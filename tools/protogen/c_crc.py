"""The table of CRC-32 (IEEE): the effect of each byte value."""

from __future__ import annotations

from .schema import GENERATED

POLYNOMIAL = 0xEDB88320  # reflected
PER_LINE = 8


def entry(byte: int) -> int:
    crc = byte
    for _ in range(8):
        crc = crc >> 1 ^ (POLYNOMIAL if crc & 1 else 0)
    return crc


def source() -> str:
    words = [f"0x{entry(byte):08X}," for byte in range(256)]
    lines = [
        f"// {GENERATED}",
        '#include "wire/crc32.h"',
        "",
        "const uint32_t bt_crc32_table[256] = {",
        *(f"    {' '.join(words[k : k + PER_LINE])}" for k in range(0, 256, PER_LINE)),
        "};",
    ]
    return "\n".join(lines) + "\n"
