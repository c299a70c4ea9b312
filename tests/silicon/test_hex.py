"""The F405's .hex has both parts of its image, for programmers that take no two files (CubeProgrammer, OpenOCD)."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.append(str(ROOT / "tests/hil"))

from rig import all_rigs, in_ci, prepare  # noqa: E402


def parts(text: str) -> dict[int, bytes]:
    """Runs of bytes by address (Intel HEX, types 0 and 4)."""
    runs: dict[int, bytes] = {}
    above = 0
    for line in text.split():
        data = bytes.fromhex(line[1:])
        assert sum(data) % 256 == 0
        count, at, kind = data[0], int.from_bytes(data[1:3], "big"), data[3]
        if kind == 4:
            above = int.from_bytes(data[4:6], "big") << 16
        elif kind == 0:
            begin = next((a for a, run in runs.items() if a + len(run) == above + at), above + at)
            runs[begin] = runs.get(begin, b"") + data[4 : 4 + count]
    return runs


def test_the_hex_has_both_parts() -> None:
    why = prepare(all_rigs()["f405"])
    if why is not None:
        pytest.fail(why) if in_ci() else pytest.skip(why)
    runs = parts((ROOT / "build/f405/biotac-f405.hex").read_text())
    image = (ROOT / "build/f405/biotac-f405.bin").read_bytes()
    assert runs == {0x0800_0000: image[:8], 0x0800_C000: image}
