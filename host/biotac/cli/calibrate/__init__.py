"""biotac calibrate WHAT"""

from __future__ import annotations

import argparse

from . import contact as calibrate_contact
from . import population as calibrate_population
from . import pressure as calibrate_pressure
from . import scale as calibrate_scale
from . import weights as calibrate_weights
from . import wrench as calibrate_wrench

EXAMPLE = calibrate_wrench.EXAMPLE

WHATS = (
    calibrate_wrench,
    calibrate_population,
    calibrate_scale,
    calibrate_weights,
    calibrate_pressure,
    calibrate_contact,
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to calibrate; each has its own arguments."""
    what = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    for module in WHATS:
        one = what.add_parser(
            module.NAME,
            help=module.HELP,
            description=module.HELP,
            epilog=f"example: {module.EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        # of the verb already; here for those who write it last
        one.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help="print JSON for machines")
        module.add_arguments(one)
        one.set_defaults(calibrate=module.run)


def run(args: argparse.Namespace) -> int:
    """Do what was named."""
    return int(args.calibrate(args))
