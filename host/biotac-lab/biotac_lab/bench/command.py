"""biotac-lab bench WHAT"""

from __future__ import annotations

import argparse
import importlib
import json
from pathlib import Path
from typing import Any

from biotac import InputError

from ..report import Show, Table

ABOUT = "Measure batch maths, decoding, the live path, recordings, force against cycles, physics in the loop."
EXAMPLE = "biotac-lab bench batch"
#: Each is a module beside this one with ``measure``, and the arguments that it takes.
BENCHES = {
    "batch": ("biotac.compute on whole recordings, against NumPy", ("frames",)),
    "decode": ("the link's bytes to arrays, against pymavlink and Python", ("frames",)),
    "live": ("link to callback, against a pyserial thread", ("rounds",)),
    "newtons": ("cycles of a force against its error on real fingers", ("files", "picture")),
    "world": ("a round of physics in the loop, in hundreds of rounds", ("rounds",)),
    "recording": ("size and load time of a recording", ("source", "fingers", "seconds")),
}
DEFAULTS: dict[str, Any] = {"frames": None, "source": "press.toml", "rounds": 5, "files": [], "picture": None,
                            "fingers": 5, "seconds": 600.0}  # fmt: skip
LIMITS = {"frames": (1000, 1_000_000), "rounds": (1, 1_000_000), "fingers": (1, 5), "seconds": (1, 36_000)}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to measure, and how much of it."""
    about = "; ".join(f"{name}: {text}" for name, (text, _) in BENCHES.items())
    parser.add_argument("what", metavar="WHAT", choices=list(BENCHES), help=about)
    parser.add_argument(
        "files", metavar="REC", nargs="*", type=Path, help="newtons: fingers on a force plate, as for calibrate wrench"
    )
    parser.add_argument("--picture", metavar="FILE", type=Path, help="newtons: draw it here (.png)")
    parser.add_argument("--frames", type=int, metavar="N", help="batch: default 200000; decode: default 30000")
    parser.add_argument("--source", default="press.toml", help="recording: what to play (default %(default)s)")
    parser.add_argument("--fingers", type=int, default=5, help="recording: how many (default %(default)s)")
    parser.add_argument("--seconds", type=float, default=600.0, help="recording: device time (default %(default)g)")
    parser.add_argument(
        "--rounds", type=int, default=5, metavar="N", help="live: a reader; world: hundreds (default %(default)s)"
    )


def run(args: argparse.Namespace, show: Show) -> int:
    """Print the tables and return 0 whatever they are: judging them is up to people."""
    _, accepted = BENCHES[args.what]
    for name, default in DEFAULTS.items():
        value = getattr(args, name)
        if name not in accepted and value != default:
            raise InputError(
                f"bench {args.what} does not use {'a recording' if name == 'files' else f'--{name}'}; drop it"
            )
        if value is not None and name in LIMITS and not LIMITS[name][0] <= value <= LIMITS[name][1]:
            raise InputError(f"--{name} is {value:g}, expected {LIMITS[name][0]} to {LIMITS[name][1]}")
    given = {name: getattr(args, name) for name in accepted if getattr(args, name) is not None}
    tables: list[Table] = importlib.import_module(f"{__package__}.{args.what}").measure(**given, show=show)
    show("")
    if args.json:
        print(json.dumps({"bench": args.what, "tables": [table.facts() for table in tables]}))
    else:
        print("\n".join(line for table in tables for line in table.page()))
    return 0
