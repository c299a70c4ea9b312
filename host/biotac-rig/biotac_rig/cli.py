"""The ``biotac-rig`` command. Errors are one line on stderr, with ``biotac``'s exit codes."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from biotac import BiotacError

USAGE = """\
usage: biotac-rig two-boards [LEAD...]   two emulated Picos wired to each other, each on a pty
       biotac-rig soak [--help]          open, close and spoil a board for minutes or hours
The sensor board is `biotac sim SOURCE --sensor-port PORT`, its leads `biotac doctor PORT --sensor-port SENSOR`."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; return its exit code."""
    verb, *words = [*(sys.argv[1:] if argv is None else argv), ""][:-1] or ["--help"]
    try:
        if verb == "two-boards":
            from . import two_boards

            return two_boards.main(words)
        if verb == "soak":
            from . import soak

            return soak.main(words)
    except BiotacError as error:
        print(f"biotac-rig: {error}", file=sys.stderr)
        return error.exit_code
    print(USAGE, file=sys.stdout if verb in ("-h", "--help") else sys.stderr)
    return 0 if verb in ("-h", "--help") else 2
