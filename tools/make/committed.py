"""Generated files are committed: write them, or check that none has drifted."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import __main__

ROOT = Path(__file__).resolve().parents[2]


def write_or_check(outputs: dict[Path, str], source: str) -> int:
    """Run a generator's whole command line; the help is the first docstring line of the program that runs.

    Without arguments it writes the files that differ. With --check it writes nothing, names the files that drifted from
    ``source``, and returns 1 if there are any.
    """
    parser = argparse.ArgumentParser(description=(__main__.__doc__ or "").splitlines()[0])
    parser.add_argument("--check", action="store_true", help="only compare")
    check = parser.parse_args().check
    drifted = [path for path, text in outputs.items() if not path.exists() or path.read_text(encoding="utf-8") != text]
    if check and drifted:
        names = ", ".join(str(path.relative_to(ROOT)) for path in drifted)
        print(f"drifted from {source}: {names}; run {Path(sys.argv[0]).resolve().relative_to(ROOT)}", file=sys.stderr)
        return 1
    if not check:
        for path in drifted:
            path.write_text(outputs[path], encoding="utf-8")
    return 0
