#!/usr/bin/env python3
"""Write a flash image as UF2, the format that a Pico's drive takes (https://github.com/microsoft/uf2).

    uf2.py IMAGE.bin IMAGE.uf2 [--chip rp2350]

Refuses an image that the chip's boot ROM would refuse, but without a word: for a wrong CRC of the second-stage boot
(RP2040), or a wrong IMAGE_DEF (RP2350), by the same code as `biotac flash`.
"""

from __future__ import annotations

import argparse
import importlib.util
import struct
import sys
from pathlib import Path
from typing import Any

CODE = Path(__file__).resolve().parents[2] / "host/biotac/flash/families.py"
PAGE = 256
FLAG_FAMILY = 0x2000
MAGIC = (0x0A324655, 0x9E5D5157, 0x0AB16F30)


def families() -> Any:
    spec = importlib.util.spec_from_file_location("biotac_families", CODE)
    assert spec is not None and spec.loader is not None
    code = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = code  # dataclasses look up their module here
    spec.loader.exec_module(code)
    return code


def uf2(image: bytes, chip: str = "rp2040") -> bytes:
    """512-byte blocks, one per flash page."""
    code = families()
    family = next(family for family in code.FAMILIES if family.chip.lower() == chip)
    family.check(image)
    pages = [image[at : at + PAGE].ljust(PAGE, b"\0") for at in range(0, len(image), PAGE)]
    out = bytearray()
    for k, page in enumerate(pages):
        head = struct.pack("<8I", *MAGIC[:2], FLAG_FAMILY, code.FLASH_AT + k * PAGE, PAGE, k, len(pages), family.id)
        out += head + page.ljust(476, b"\0") + struct.pack("<I", MAGIC[2])
    return bytes(out)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("bin", type=Path)
    parser.add_argument("uf2", type=Path)
    parser.add_argument("--chip", choices=("rp2040", "rp2350"), default="rp2040")
    args = parser.parse_args()
    try:
        args.uf2.write_bytes(uf2(args.bin.read_bytes(), args.chip))
    except ValueError as error:
        sys.exit(f"uf2.py: {args.bin}: {error}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
