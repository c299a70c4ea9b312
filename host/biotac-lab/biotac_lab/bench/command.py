"""biotac-lab bench WHAT"""

from __future__ import annotations

import argparse
import importlib
from pathlib import Path
from typing import Any

from biotac import InputError

from ..report import Outcome, Show, Table, of_tables

ABOUT = "Measure batch maths, decoding, the live path, recordings, force against cycles, physics in the loop."
EXAMPLE = "biotac-lab bench batch"
#: Each is a module beside this one with ``measure``.
BENCHES = {
    "batch": "biotac.compute on whole recordings, against NumPy",
    "decode": "the link's bytes to arrays, against pymavlink and Python",
    "live": "link to callback, against a pyserial thread",
    "newtons": "cycles of a force against its error on real fingers",
    "world": "a round of physics in the loop",
    "recording": "size and load time of a recording",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the benchmark's name, and the options of `newtons`."""
    about = "; ".join(f"{name}: {text}" for name, text in BENCHES.items())
    parser.add_argument("what", metavar="WHAT", choices=list(BENCHES), help=about)
    parser.add_argument(
        "files", metavar="REC", nargs="*", type=Path, help="newtons: fingers on a force plate, as for calibrate wrench"
    )
    parser.add_argument("--picture", metavar="FILE", type=Path, help="newtons: draw it here (.png)")


def run(args: argparse.Namespace, show: Show) -> Outcome:
    """The tables, without a limit: a verdict is up to people."""
    given: dict[str, Any] = {"files": args.files, "picture": args.picture} if args.what == "newtons" else {}
    if not given and (args.files or args.picture):
        raise InputError(f"bench {args.what} uses neither a recording nor --picture; drop them")
    tables: list[Table] = importlib.import_module(f"{__package__}.{args.what}").measure(**given, show=show)
    return of_tables(tables, {"bench": args.what, "tables": [table.facts() for table in tables]})
