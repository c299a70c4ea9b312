#!/usr/bin/env python3
"""Complete an image's description (firmware/app/image_note.h): size and CRC-32, beside the board.

    note.py IMAGE.bin [IMAGE.elf --objcopy PROGRAM]

The .elf gets the same note, so that a debugger, or a tool that makes another .uf2 from it, writes the same image.
Refuses an image that `biotac flash` would refuse for the note, by the same code, but before anybody has it.
"""

from __future__ import annotations

import argparse
import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path

CODE = Path(__file__).resolve().parents[2] / "host/biotac/flash/note.py"


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("bin", type=Path)
    parser.add_argument("elf", type=Path, nargs="?")
    parser.add_argument("--objcopy", default="arm-none-eabi-objcopy")
    args = parser.parse_args()
    spec = importlib.util.spec_from_file_location("biotac_image_note", CODE)
    assert spec is not None and spec.loader is not None
    code = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = code  # dataclasses look up their module here
    spec.loader.exec_module(code)
    path = args.bin
    try:
        image = code.seal(path.read_bytes())
        note = code.find(image)
    except ValueError as error:
        sys.exit(f"note.py: {path}: {error}")
    path.write_bytes(image)
    if args.elf is not None:
        with tempfile.NamedTemporaryFile() as section:
            section.write(code.bytes_of(image))
            section.flush()
            subprocess.run([args.objcopy, "--update-section", f".image_note={section.name}", str(args.elf)], check=True)
            subprocess.run(
                [args.objcopy, "-O", "binary", "-R", ".boot_vectors", str(args.elf), section.name], check=True
            )
            if Path(section.name).read_bytes() != image:
                sys.exit(f"note.py: {args.elf} does not give {path}: its note is not in a section .image_note")
    wire = ".".join(map(str, note.wire))
    print(f"note  board {note.board}, firmware {note.version}, wire {wire}, CRC-32 {note.crc32:08x}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
