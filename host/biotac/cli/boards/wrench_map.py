"""biotac map WHAT"""

from __future__ import annotations

import argparse
import json
from functools import partial
from pathlib import Path

import biotac

from ...errors import InputError
from ...keep import map_file as file
from ...wire.sensor_gen import MAX_SENSORS
from . import subverbs

EXAMPLE = "biotac map put /dev/ttyACM0 thumb.json --finger 0 --save"

run = subverbs.run


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to do, each with its own arguments."""
    what = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    add = partial(subverbs.add, what, "map")

    show = add("show", _show, "What a board, a recording or a file holds.", "show /dev/ttyACM0")
    show.add_argument("where", metavar="PORT|FILE")

    recorded = "replay:REC gets what a recording was made with"
    subverbs.add_get_put_clear(add, _get, _put, _clear, "Back to what the settings say.", get_port_help=recorded)


def _get(args: argparse.Namespace) -> None:
    with biotac.open(args.port) as hand:
        blob = hand.get_map(args.finger)
        if blob is None:
            raise InputError(f"finger {args.finger} on {args.port} has no wrench map; `put` gives it one")
        provenance = subverbs.provenance(args, hand)
    file.save(args.file, blob, provenance, overwrite=args.force)
    _say(args, f"{args.file}: {file.title(blob)}", blob)


def _put(args: argparse.Namespace) -> None:
    blob = file.load(args.file)
    with biotac.open(args.port) as hand:
        hand.set_map(args.finger, blob, force=args.force)
        blob = hand.get_map(args.finger) or blob
        if args.save:
            hand.save_settings()
    _say(args, subverbs.put_line(args, file.title(blob)), blob)


def _clear(args: argparse.Namespace) -> None:
    subverbs.clear(args, lambda hand: hand.clear_map(args.finger), "the settings")


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
            print(f"finger {finger}: {subverbs.state_words(state)}; {file.title(its)}")
        elif finger in present:
            print(f"finger {finger}: none, the settings hold")


def _say(args: argparse.Namespace, line: str, blob: bytes) -> None:
    print(json.dumps(file.to_dict(blob)) if args.json else line)
