"""biotac udev-setup"""

from __future__ import annotations

import argparse
import json

from ...doctor import udev

EXAMPLE = "sudo biotac udev-setup"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --print, for those who install the rule in another way."""
    parser.add_argument("--print", action="store_true", help="print the rule and install nothing")


def run(args: argparse.Namespace) -> int:
    """Print or install the rule."""
    if not args.print:
        udev.install()
    if args.json:
        print(json.dumps({"path": str(udev.RULES), "installed": not args.print, "rule": udev.rule()}))
    elif args.print:
        print(udev.rule(), end="")
    else:
        print(f"wrote {udev.RULES}; now run sudo udevadm control --reload, and plug the board in again")
    return 0
