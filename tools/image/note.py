#!/usr/bin/env python3
"""Complete what an image says of itself (firmware/app/image_note.h): its size and CRC-32, beside what it is for.

    note.py IMAGE.bin

Refuses an image that `biotac flash` would refuse for its note, by the same code, but before anybody has it.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

CODE = Path(__file__).resolve().parents[2] / "host/biotac/flash/note.py"


def main() -> int:
    if len(sys.argv) != 2:
        sys.exit((__doc__ or "").strip())
    spec = importlib.util.spec_from_file_location("biotac_image_note", CODE)
    assert spec is not None and spec.loader is not None
    code = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = code  # dataclasses look up their module here
    spec.loader.exec_module(code)
    path = Path(sys.argv[1])
    try:
        image = code.seal(path.read_bytes())
        note = code.find(image)
    except ValueError as error:
        sys.exit(f"note.py: {path}: {error}")
    path.write_bytes(image)
    wire = ".".join(map(str, note.wire))
    print(f"note  board {note.board}, firmware {note.version}, wire {wire}, CRC-32 {note.crc32:08x}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
