#!/usr/bin/env python3
"""Write a flash image as UF2, the format that an RP2040's drive takes (https://github.com/microsoft/uf2).

    uf2.py IMAGE.bin IMAGE.uf2

Refuses an image whose second-stage boot has a wrong CRC: the chip would refuse it too, but without a word.
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from image.boot2 import CODE_BYTES, block

FLASH = 0x10000000
PAGE = 256
FAMILY_RP2040 = 0xE48BFF56
FLAG_FAMILY = 0x2000
MAGIC = (0x0A324655, 0x9E5D5157, 0x0AB16F30)


def uf2(image: bytes) -> bytes:
    """512-byte blocks, one per flash page."""
    if image[: CODE_BYTES + 4] != block(image[:CODE_BYTES]):
        raise ValueError("the image does not begin with a second-stage boot and its CRC")
    pages = [image[at : at + PAGE].ljust(PAGE, b"\0") for at in range(0, len(image), PAGE)]
    out = bytearray()
    for k, page in enumerate(pages):
        head = struct.pack("<8I", *MAGIC[:2], FLAG_FAMILY, FLASH + k * PAGE, PAGE, k, len(pages), FAMILY_RP2040)
        out += head + page.ljust(476, b"\0") + struct.pack("<I", MAGIC[2])
    return bytes(out)


def main() -> int:
    if len(sys.argv) != 3:
        sys.exit((__doc__ or "").strip())
    try:
        Path(sys.argv[2]).write_bytes(uf2(Path(sys.argv[1]).read_bytes()))
    except ValueError as error:
        sys.exit(f"uf2.py: {error}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
