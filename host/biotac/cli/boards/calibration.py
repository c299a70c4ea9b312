"""biotac calibration WHAT"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import biotac

from ...errors import InputError
from ...keep import Calibration, eeprom
from ...keep import calibration_file as file
from ...keep.chip import KINDS, Chip
from ...version import __version__
from ...wire import messages_gen as wire
from ...wire.sensor_gen import MAX_SENSORS
from . import subverbs

EXAMPLE = "biotac calibration put /dev/ttyACM0 thumb.json --finger 0 --save"

run = subverbs.run


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to do, each with its own arguments."""
    what = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    add = partial(subverbs.add, what, "calibration")

    show = add("show", _show, "What a board, a file or an EEPROM holds.", "show thumb.json")
    show.add_argument("where", metavar="PORT|FILE", nargs="?", help="left out with --i2c")
    _add_eeprom(show, required=False)

    subverbs.add_get_put_clear(add, _get, _put, _clear, "Back to the board's settings.")

    store = add("store", _store, "Into an EEPROM.", "store --i2c 1:0x50 --chip 24c32 thumb.json")
    store.add_argument("file", metavar="FILE", nargs="?", type=Path, help="left out: standard input")
    _add_eeprom(store, required=True)

    load = add("load", _load, "From an EEPROM.", "load --i2c 1:0x50 --chip 24c32 thumb.json")
    load.add_argument("file", metavar="FILE", nargs="?", type=Path, help="left out: standard output")
    load.add_argument("--force", action="store_true", help="overwrite FILE")
    _add_eeprom(load, required=True)


def _add_eeprom(parser: argparse.ArgumentParser, *, required: bool) -> None:
    parser.add_argument("--i2c", metavar="BUS:ADDRESS", required=required, help="where the EEPROM is, such as 1:0x50")
    parser.add_argument("--chip", choices=KINDS, required=required, metavar="KIND", help=f"{', '.join(KINDS)}")


# ---- board -------------------------------------------------------------------------------------


def _get(args: argparse.Namespace) -> None:
    with biotac.open(args.port) as hand:
        its = hand.calibration(args.finger)
        if its is None:
            raise InputError(f"finger {args.finger} on {args.port} has no calibration; `put` gives it one")
        provenance = subverbs.provenance(args, hand)
    file.save(args.file, its, provenance, overwrite=args.force)
    _say(args, f"{args.file}: {_title(its)}", its)


def _put(args: argparse.Namespace) -> None:
    its = file.load(args.file)
    with biotac.open(args.port) as hand:
        hand.set_calibration(args.finger, replace(its, serial="") if args.force else its)
        its = hand.calibration(args.finger) or its
        if args.save:
            hand.save_settings()
    _say(args, subverbs.put_line(args, _title(its)), its)


def _clear(args: argparse.Namespace) -> None:
    subverbs.clear(args, lambda hand: hand.clear_calibration(args.finger), "the settings")


# ---- EEPROM ------------------------------------------------------------------------------------


def _store(args: argparse.Namespace) -> None:
    its = file.load(args.file) if args.file else file.loads(sys.stdin.read(), "standard input")
    with Chip(args.i2c, args.chip) as chip:
        written = eeprom.store(chip, its)
    _say(args, f"EEPROM {args.i2c}: {_title(its)}, {'stored' if written else 'which it held already'}", its)


def _load(args: argparse.Namespace) -> None:
    with Chip(args.i2c, args.chip) as chip:
        its = eeprom.load(chip)
    provenance = {"software": f"biotac-gateway {__version__}", "from": f"EEPROM {args.i2c}"}
    if args.file is None:
        print(file.dumps(its, provenance), end="")
        return
    file.save(args.file, its, provenance, overwrite=args.force)
    _say(args, f"{args.file}: {_title(its)}", its)


# ---- show --------------------------------------------------------------------------------------


def _show(args: argparse.Namespace) -> None:
    if (args.where is None) == (args.i2c is None):
        raise InputError("show wants one of PORT, FILE and --i2c; `biotac calibration show --help` has an example")
    if args.i2c is not None:
        if args.chip is None:
            raise InputError(f"--i2c {args.i2c} wants --chip; expected one of {', '.join(KINDS)}")
        with Chip(args.i2c, args.chip) as chip:
            its = eeprom.load(chip)
        _say(args, f"EEPROM {args.i2c}: {_title(its)}", its, whole=True)
    elif Path(args.where).is_file() or args.where.endswith(".json"):
        its = file.load(Path(args.where))
        _say(args, f"{args.where}: {_title(its)}", its, whole=True)
    else:
        _show_board(args)


def _show_board(args: argparse.Namespace) -> None:
    with biotac.open(args.where) as hand:
        fingers = {f: (hand.calibration_state(f), hand.calibration(f)) for f in range(MAX_SENSORS)}
        present = hand.fingers
    if args.json:
        print(
            json.dumps({f: {"state": s.name, **(file.to_dict(its) if its else {})} for f, (s, its) in fingers.items()})
        )
        return
    for finger, (state, its) in fingers.items():
        if its is not None:
            print("\n".join([f"finger {finger}: {subverbs.state_words(state)}; {_title(its)}", *_lines(its)]))
        elif finger in present:
            print(f"finger {finger}: none, the settings hold")


def _say(args: argparse.Namespace, line: str, its: Calibration, *, whole: bool = False) -> None:
    if args.json:
        print(json.dumps(file.to_dict(its)))
    else:
        print("\n".join([line, *(_lines(its) if whole else [])]))


def _title(its: Calibration) -> str:
    return f"for {f'sensor {its.serial}' if its.serial else 'any sensor'}, {file.when(its.made_s)}"


def _lines(its: Calibration) -> list[str]:
    return [
        f"  {setting.name.lower()} = {value} {wire.SETTINGS[setting].unit}" for setting, value in its.settings().items()
    ]
