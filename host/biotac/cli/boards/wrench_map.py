"""biotac map WHAT"""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from biotac import Hand

from ...map import file
from . import subverbs

EXAMPLE = "biotac map put /dev/ttyACM0 index.json --finger index --save"

run = subverbs.run


def _write(hand: Hand, finger: int, blob: bytes, force: bool) -> None:
    hand.set_map(finger, blob, force=force)


MAP = subverbs.Kept("wrench map", file, Hand.get_map, Hand.map_state, _write, Hand.clear_map, file.title)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subverbs, each with its own arguments."""
    what = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    add = partial(subverbs.add, what, "map")

    show = add("show", _show, "What a board, a recording or a file holds.", "show /dev/ttyACM0")
    show.add_argument("where", metavar="PORT|FILE")

    MAP.add(
        add, "Back to what the settings say.", get_port_help="with replay:REC, the map that the recording was made with"
    )


def _show(args: argparse.Namespace) -> None:
    if args.where.endswith(".json"):
        MAP.say(args, args.where, file.load(Path(args.where)))
    else:
        MAP.show_board(args, f"replay:{args.where}" if Path(args.where).is_file() else args.where)
