"""The ``biotac-lab`` command. Exit codes are those of ``biotac``: 1 where --check finds a limit missed."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Sequence

from biotac import BiotacError, InputError

from .bench import command as bench
from .calibrate import direction_command as direction
from .calibrate import finger_command as finger
from .calibrate import interval
from .calibrate import population_command as population
from .experiments import command as experiments
from .experiments import seeds
from .grasp import command as grasp
from .grasp import slip_command as slip


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; return the exit code. Errors are one line on stderr."""
    parser = argparse.ArgumentParser(prog="biotac-lab", description=__doc__.splitlines()[0], allow_abbrev=False)
    verbs = parser.add_subparsers(required=True, metavar="VERB")
    known = {
        "experiment": experiments,
        "seeds": seeds,
        "population": population,
        "interval": interval,
        "direction": direction,
        "finger": finger,
        "grasp": grasp,
        "slip": slip,
        "bench": bench,
    }
    for name, module in known.items():
        about = module.ABOUT.replace("%", "%%")
        verb = verbs.add_parser(name, help=about, description=module.ABOUT, allow_abbrev=False)
        verb.add_argument("--json", action="store_true", help="print JSON for machines")
        verb.epilog = f"example: {module.EXAMPLE}"
        module.add_arguments(verb)
        verb.set_defaults(run=module.run)  # returns an Outcome
    args = parser.parse_args(argv)
    progress = Progress()
    try:
        outcome = args.run(args, progress.show)
        progress.clear()
        print(json.dumps(outcome.facts) if args.json else outcome.page)
        return int(vars(args).get("check", False) and not outcome.met)
    except BiotacError as error:
        progress.clear()
        print(f"biotac-lab: {' '.join(str(error).split())}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt:
        print("biotac-lab: interrupted", file=sys.stderr)
        return 130
    except OSError as error:
        print(f"biotac-lab: {error}; check the path and the free disk space", file=sys.stderr)
        return InputError.exit_code


class Progress:
    """A progress line on stderr for work of more than a second, on a terminal only."""

    def __init__(self) -> None:
        self._next = time.monotonic() + 1.0

    def show(self, text: str) -> None:
        """Replace the line by ``text``, at most five times a second; an empty one clears it."""
        now = time.monotonic()
        if sys.stderr.isatty() and (now >= self._next or not text):
            self._next = now + 0.2
            print(f"\r\033[K{text}", end="", file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Clear the line."""
        self.show("")
