"""What `biotac calibration` and `biotac map` share: their verbs are alike, get, put, clear and show."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import biotac

from ...version import __version__
from ...wire.identity import serial_text
from .. import values


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


def add_get_put_clear(add: Any, get: Any, put: Any, clear: Any, cleared: str, get_port_help: str | None = None) -> None:
    """The three verbs by which something goes from and to a board; ``cleared`` says where clear leads."""
    parser = add("get", get, "From a board into a file.", "get /dev/ttyACM0 --finger 0 thumb.json")
    parser.add_argument("port", metavar="PORT", help=get_port_help)
    parser.add_argument("file", metavar="FILE", type=Path)
    parser.add_argument("--force", action="store_true", help="overwrite FILE")
    add_finger(parser)

    parser = add("put", put, "From a file to a board.", "put /dev/ttyACM0 thumb.json --finger 0 --save")
    parser.add_argument("port", metavar="PORT")
    parser.add_argument("file", metavar="FILE", type=Path)
    parser.add_argument("--force", action="store_true", help="for whatever sensor is there, not its own alone")
    add_finger(parser)
    add_save(parser)

    parser = add("clear", clear, cleared, "clear /dev/ttyACM0 --finger 0 --save")
    parser.add_argument("port", metavar="PORT")
    add_finger(parser)
    add_save(parser)


def add_finger(parser: argparse.ArgumentParser) -> None:
    """Which finger; there is no default, as a wrong one would not be noticed."""
    parser.add_argument("--finger", metavar="NAME", type=values.finger, required=True, help="name or chip select")


def add_save(parser: argparse.ArgumentParser) -> None:
    """Whether the board shall keep it."""
    parser.add_argument("--save", action="store_true", help="keep it over reboots, with all settings in force")


def provenance(args: argparse.Namespace, hand: biotac.Hand) -> dict[str, Any]:
    """Where a file that `get` writes comes from."""
    board = {"from": args.port, "board_serial": serial_text(hand.info), "finger": args.finger}
    return {"software": f"biotac-gateway {__version__}", **board}


def put_line(args: argparse.Namespace, title: str) -> str:
    """What `put` says."""
    kept = "saved" if args.save else "until the next reboot (--save keeps it)"
    return f"finger {args.finger}: in force, {kept}; {title}"


def clear(args: argparse.Namespace, drop: Callable[[biotac.Hand], None], then: str) -> None:
    """Do what `clear` does; ``then`` is what holds afterwards."""
    with biotac.open(args.port) as hand:
        drop(hand)
        if args.save:
            hand.save_settings()
    kept = "saved" if args.save else "until the next reboot (--save keeps it so)"
    print(json.dumps({"finger": args.finger}) if args.json else f"finger {args.finger}: {then} hold, {kept}")


def state_words(state: biotac.CalibrationState) -> str:
    """Whether it is what the finger's results come from."""
    in_force = state == biotac.CalibrationState.IN_FORCE
    return "in force" if in_force else "not in force, another sensor is there"


def run(args: argparse.Namespace) -> int:
    """Do what was asked for."""
    args.action(args)
    return 0
