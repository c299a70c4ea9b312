"""The table of CRC-32 (IEEE): the effect of each byte value."""

from __future__ import annotations

import zlib

from .schema import GENERATED

PER_LINE = 8
ONES = 0xFFFFFFFF  # zlib's start and end


def source() -> str:
    words = [f"0x{zlib.crc32(bytes([byte]), ONES) ^ ONES:08X}," for byte in range(256)]
    lines = [
        f"// {GENERATED}",
        '#include "wire/crc32.h"',
        "",
        "const uint32_t bt_crc32_table[256] = {",
        *(f"    {' '.join(words[k : k + PER_LINE])}" for k in range(0, 256, PER_LINE)),
        "};",
    ]
    return "\n".join(lines) + "\n"
