#!/usr/bin/env python3
"""Write everything that is derived from protocol/sensor.toml and protocol/link.toml.

tools/gen_protocol.py           write the generated files
tools/gen_protocol.py --check   exit 1, naming the files, when any of them has drifted
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "tools"))

from protogen import c_fold, c_sensor, c_wire, docs, python_code, schema  # noqa: E402


def outputs(root: Path) -> dict[Path, str]:
    """Map every generated path to the text it must have."""
    contract = schema.load(root / "protocol")
    return {
        root / "firmware/core/sensor_gen.h": c_sensor.header(contract),
        root / "firmware/core/sensor_gen.c": c_sensor.source(contract),
        root / "firmware/core/fold_gen.h": c_fold.header(contract),
        root / "firmware/core/fold_gen.c": c_fold.source(contract),
        root / "firmware/core/wire_gen.h": c_wire.header(contract),
        root / "firmware/core/wire_gen.c": c_wire.source(contract),
        root / "host/biotac/_sensor.py": python_code.sensor(contract),
        root / "host/biotac/_wire.py": python_code.wire(contract),
        root / "protocol/MESSAGES.md": docs.messages(contract),
        root / "protocol/schema.json": schema.canonical(contract, with_docs=True),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare, do not write")
    args = parser.parse_args()
    drifted = []
    for path, text in outputs(ROOT).items():
        if path.exists() and path.read_text(encoding="utf-8") == text:
            continue
        drifted.append(path.relative_to(ROOT))
        if not args.check:
            path.write_text(text, encoding="utf-8")
    if args.check and drifted:
        names = ", ".join(map(str, drifted))
        print(f"drifted from protocol/*.toml: {names}; run tools/gen_protocol.py", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
