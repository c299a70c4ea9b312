"""biotac calibrate WHAT"""

from __future__ import annotations

import argparse

from . import population, press, wrench

EXAMPLE = wrench.EXAMPLE

WHATS = (wrench, press, population)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to calibrate; each has its own arguments."""
    what = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    for module in WHATS:
        one = what.add_parser(
            module.NAME,
            help=module.HELP,
            description=module.HELP,
            epilog=f"example: {module.EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        # The verb has --json already; here it is for those who write it last.
        one.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help="print JSON for machines")
        module.add_arguments(one)
        one.set_defaults(calibrate=module.run)


def run(args: argparse.Namespace) -> int:
    """Run the named calibration."""
    return int(args.calibrate(args))
