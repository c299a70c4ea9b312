"""biotac calibrate contact"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from ...calibrate.wrench.contact_errors import compare
from .. import values

NAME = "contact"
HELP = "How well a wrench says where a finger is touched: closed form against the paper's 0.5 mm mesh."
EXAMPLE = "biotac calibrate contact --contacts 4000"
MOST = 100_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the number of contacts."""
    parser.add_argument(
        "--contacts", type=values.count(MOST), default=4000, metavar="N", help="random ones (default %(default)s)"
    )
    parser.add_argument("--seed", type=int, default=0, help="of the random contacts (default %(default)s)")


def run(args: argparse.Namespace) -> int:
    """Print one line per method and noise."""
    found = compare(args.contacts, seed=args.seed)
    if args.json:
        print(json.dumps({"contacts": args.contacts, "errors": [asdict(error) for error in found]}))
        return 0
    print(f"{args.contacts} contacts, distance to the true one in mm      RMS        p95        max   found")
    for its in found:
        numbers = "  ".join(f"{value:9.2g}" for value in (its.rms_mm, its.p95_mm, its.max_mm))
        print(f"  {its.noise:<22} {its.method:<18} {numbers}  {its.found:6d}")
    return 0
