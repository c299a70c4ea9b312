#!/usr/bin/env python3
"""Run the tests that measure the error of the number, and write their rows into the page of that name.

tools/make/wrong_by_page.py [FILE...]   of these tests only; the others' rows stay
"""

from __future__ import annotations

import subprocess
import sys

from committed import ROOT

HEAD_END = "|---|---|---|---|---|---|\n"
PAGE = ROOT / "host/docs/reference/wrong_by.md"


def main(files: list[str]) -> None:
    """Replace the page's rows by the tests' output; a cause that is new comes last."""
    tests = files or [str(p) for p in ROOT.glob("tests/**/test_*.py") if "import wrong_by" in p.read_text("utf-8")]
    command = [sys.executable, "-m", "pytest", "-q", "-s", *tests]
    ran = subprocess.run(command, cwd=ROOT, text=True, stdout=subprocess.PIPE, check=False)
    text, table = PAGE.read_text("utf-8").split(HEAD_END)
    lines, _, rest = table.partition("\n\n")
    rows = {line.split("|")[1].strip(): line for line in lines.splitlines() if line.startswith("|")}
    for line in ran.stdout.splitlines():
        if line.startswith("ROW|"):
            cells = line.split("|")[1:]
            rows[cells[0]] = f"| {' | '.join(cells)} |"
    PAGE.write_text(text + HEAD_END + "\n".join(rows.values()) + f"\n\n{rest}", "utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
