"""biotac calibrate WHAT"""

from __future__ import annotations

import argparse

from .. import values
from ..boards import calibration
from . import population, press, wrench

EXAMPLE = wrench.EXAMPLE


def add_arguments(parser: argparse.ArgumentParser) -> None:
    verbs = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    for module in (wrench, press, population):
        module.add_arguments(values.add_subverb(verbs, module.NAME, module.run, module.HELP, module.EXAMPLE))
    calibration.add_subverbs(verbs)
