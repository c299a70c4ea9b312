"""What the verbs with verbs of their own share: `biotac calibration put`, `biotac map put` and so on."""

from __future__ import annotations

import argparse
from typing import Any

from .._sensor import MAX_SENSORS


def add(what: Any, verb: str, name: str, action: Any, text: str, example: str) -> argparse.ArgumentParser:
    """``name`` among ``what``, the subparsers of ``verb``; ``example`` is how it is called, behind "biotac VERB"."""
    parser: argparse.ArgumentParser = what.add_parser(
        name,
        help=text,
        description=text,
        epilog=f"example: biotac {verb} {example}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help="print JSON for machines")
    parser.set_defaults(action=action)
    return parser


def add_finger(parser: argparse.ArgumentParser) -> None:
    """Which finger; there is no default, as a wrong one would not be noticed."""
    parser.add_argument("--finger", type=int, choices=range(MAX_SENSORS), required=True, metavar="N")


def add_save(parser: argparse.ArgumentParser) -> None:
    """Whether the board shall keep it."""
    parser.add_argument("--save", action="store_true", help="keep it over reboots, with all settings in force")


def run(args: argparse.Namespace) -> int:
    """Do what was asked for."""
    args.action(args)
    return 0
