"""biotac map WHAT"""

from __future__ import annotations

import argparse
import json
from functools import partial
from pathlib import Path

import biotac

from .._sensor import MAX_SENSORS
from ..calibration import map_file as file
from ..errors import InputError
from ..identity import serial_text
from ..version import __version__
from . import subverbs

NAME = "map"
HELP = "Show, get, put or clear the wrench map that a board computes a finger's force by."
EXAMPLE = "biotac map put /dev/ttyACM0 thumb.json --finger 0 --save"

run = subverbs.run

State = biotac.CalibrationState


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to do, each with its own arguments."""
    what = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    add = partial(subverbs.add, what, NAME)

    show = add("show", _show, "What a board, a recording or a file holds.", "show /dev/ttyACM0")
    show.add_argument("where", metavar="PORT|FILE")

    get = add("get", _get, "From a board into a file.", "get /dev/ttyACM0 --finger 0 thumb.json")
    get.add_argument("port", metavar="PORT", help="replay:REC gets what a recording was made with")
    get.add_argument("file", metavar="FILE", type=Path)
    get.add_argument("--force", action="store_true", help="overwrite FILE")
    subverbs.add_finger(get)

    put = add("put", _put, "From a file to a board.", "put /dev/ttyACM0 thumb.json --finger 0 --save")
    put.add_argument("port", metavar="PORT")
    put.add_argument("file", metavar="FILE", type=Path)
    put.add_argument("--force", action="store_true", help="for whatever sensor is there, not its own alone")
    subverbs.add_finger(put)
    subverbs.add_save(put)

    clear = add("clear", _clear, "Back to the gains.", "clear /dev/ttyACM0 --finger 0 --save")
    clear.add_argument("port", metavar="PORT")
    subverbs.add_finger(clear)
    subverbs.add_save(clear)


def _get(args: argparse.Namespace) -> None:
    with biotac.open(args.port) as hand:
        blob = hand.get_map(args.finger)
        if blob is None:
            raise InputError(f"finger {args.finger} on {args.port} has no wrench map; `put` gives it one")
        provenance = {"from": args.port, "board_serial": serial_text(hand.info), "finger": args.finger}
    file.save(args.file, blob, {"software": f"biotac-gateway {__version__}", **provenance}, overwrite=args.force)
    _say(args, f"{args.file}: {file.title(blob)}", blob)


def _put(args: argparse.Namespace) -> None:
    blob = file.load(args.file)
    with biotac.open(args.port) as hand:
        hand.set_map(args.finger, blob, force=args.force)
        blob = hand.get_map(args.finger) or blob
        if args.save:
            hand.save_settings()
    kept = "saved" if args.save else "until the next reboot (--save keeps it)"
    _say(args, f"finger {args.finger}: in force, {kept}; {file.title(blob)}", blob)


def _clear(args: argparse.Namespace) -> None:
    with biotac.open(args.port) as hand:
        hand.clear_map(args.finger)
        if args.save:
            hand.save_settings()
    kept = "saved" if args.save else "until the next reboot (--save keeps it so)"
    print(json.dumps({"finger": args.finger}) if args.json else f"finger {args.finger}: the gains hold, {kept}")


def _show(args: argparse.Namespace) -> None:
    if args.where.endswith(".json"):
        blob = file.load(Path(args.where))
        _say(args, f"{args.where}: {file.title(blob)}", blob)
        return
    recorded = Path(args.where).is_file()
    with biotac.open(f"replay:{args.where}" if recorded else args.where) as hand:
        fingers = {f: (hand.map_state(f), hand.get_map(f)) for f in range(MAX_SENSORS)}
        present = hand.fingers
    if args.json:
        told = {f: {"state": s.name, **(file.to_dict(its) if its else {})} for f, (s, its) in fingers.items()}
        print(json.dumps(told))
        return
    for finger, (state, its) in fingers.items():
        if its is not None:
            holds = "in force" if state == State.IN_FORCE else "not in force, another sensor is there"
            print(f"finger {finger}: {holds}; {file.title(its)}")
        elif finger in present:
            print(f"finger {finger}: none, the gains hold")


def _say(args: argparse.Namespace, line: str, blob: bytes) -> None:
    print(json.dumps(file.to_dict(blob)) if args.json else line)
