"""Rows of host/docs/reference/wrong_by.md, each printed and held to the page by the test that measured it."""

import re
from pathlib import Path

from biotac.wire.messages_gen import TRUST_FLAGS, FrameFlags

PAGE = Path(__file__).resolve().parents[2] / "host/docs/reference/wrong_by.md"


def trust_of(flag: str) -> str:
    """The lowest trust that the flags named in ``flag`` leave, by the board's own table; "-" where none is."""
    named = {FrameFlags[name] for name in re.findall(r"[A-Z_]+", flag) if name in FrameFlags.__members__}
    levels = [level for level, flags in TRUST_FLAGS.items() if any(member in flags for member in named)]
    return min(levels).name if levels else "-"


def row(cause: str, error_n: float, silent_n: float, flag: str, do: str) -> None:
    """Largest error of the force in N for this cause, and the largest without the flag; the controller's reaction."""
    cells = f"{cause}|{error_n:.1f}|{silent_n:.1f}|{flag}|{trust_of(flag)}|{do}"
    print(f"\nROW|{cells}")
    rows = [line.strip("| ").replace(" | ", "|") for line in PAGE.read_text(encoding="utf-8").splitlines()]
    assert cells in rows, f"{PAGE.name} does not say what was measured: run tools/make/wrong_by_page.py"
