#!/usr/bin/env python3
"""Say what an image says of itself (firmware/app/image_note.h): board, firmware, wire.

    note.py IMAGE.bin

Refuses an image that `biotac flash` would refuse for its note, by the same code, but before anybody has it.
"""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

READER = Path(__file__).resolve().parents[2] / "host/biotac/flash/note.py"


def main() -> int:
    if len(sys.argv) != 2:
        sys.exit((__doc__ or "").strip())
    spec = importlib.util.spec_from_file_location("biotac_image_note", READER)
    assert spec is not None and spec.loader is not None
    reader = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = reader  # dataclasses look their module up
    spec.loader.exec_module(reader)
    try:
        note = reader.find(Path(sys.argv[1]).read_bytes())
    except ValueError as error:
        sys.exit(f"note.py: {sys.argv[1]}: {error}")
    print(f"note  board {note.board}, firmware {note.version}, wire {'.'.join(map(str, note.wire))}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
