"""biotac calibration WHAT"""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

from biotac import Calibration, Hand

from ...documents import made_text
from ...errors import InputError
from ...keep import calibration_file as file
from ...keep import eeprom
from ...keep.chip import KINDS, Chip
from ...version import __version__
from ...wire.identity import setting_text
from . import subverbs

EXAMPLE = "biotac calibration put /dev/ttyACM0 index.json --finger index --save"

run = subverbs.run


def _write(hand: Hand, finger: int, calibration: Calibration, force: bool) -> None:
    hand.set_calibration(finger, replace(calibration, serial="") if force else calibration)


def _title(calibration: Calibration) -> str:
    sensor = f"sensor {calibration.serial}" if calibration.serial else "any sensor"
    return f"for {sensor}, {made_text(calibration.made_s)}"


def _lines(calibration: Calibration) -> list[str]:
    return [f"  {setting_text(setting, value)}" for setting, value in calibration.settings().items()]


CALIBRATION = subverbs.Kept(
    "calibration", file, Hand.calibration, Hand.calibration_state, _write, Hand.clear_calibration, _title, _lines
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subverbs, each with calibration own arguments."""
    what = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    add = partial(subverbs.add, what, "calibration")

    show = add("show", _show, "What a board, a file or an EEPROM holds.", "show index.json")
    show.add_argument("where", metavar="PORT|FILE", nargs="?", help="left out with --i2c")
    _add_eeprom(show, required=False)

    CALIBRATION.add(add, "Back to the board's settings.")

    store = add("store", _store, "Into an EEPROM.", "store --i2c 1:0x50 --chip 24c32 index.json")
    store.add_argument("file", metavar="FILE", nargs="?", type=Path, help="default: standard input")
    _add_eeprom(store, required=True)

    load = add("load", _load, "From an EEPROM.", "load --i2c 1:0x50 --chip 24c32 index.json")
    load.add_argument("file", metavar="FILE", nargs="?", type=Path, help="default: standard output")
    load.add_argument("--force", action="store_true", help="overwrite FILE")
    _add_eeprom(load, required=True)


def _add_eeprom(parser: argparse.ArgumentParser, *, required: bool) -> None:
    parser.add_argument("--i2c", metavar="BUS:ADDRESS", required=required, help="where the EEPROM is, such as 1:0x50")
    parser.add_argument("--chip", choices=KINDS, required=required, metavar="KIND", help=f"{', '.join(KINDS)}")


def _store(args: argparse.Namespace) -> None:
    calibration = file.load(args.file) if args.file else file.loads(sys.stdin.read(), "standard input")
    with Chip(args.i2c, args.chip) as chip:
        written = eeprom.store(chip, calibration)
    more = ", stored" if written else ", which it held already"
    CALIBRATION.say(args, f"EEPROM {args.i2c}", calibration, more=more)


def _load(args: argparse.Namespace) -> None:
    with Chip(args.i2c, args.chip) as chip:
        calibration = eeprom.load(chip)
    source = {"from": f"EEPROM {args.i2c}"}
    if args.file is None:
        print(file.dumps(calibration, {"software": f"biotac-gateway {__version__}", **source}), end="")
    else:
        CALIBRATION.save(args, calibration, source)


def _show(args: argparse.Namespace) -> None:
    if (args.where is None) == (args.i2c is None):
        raise InputError("expected exactly one of PORT, FILE and --i2c; see `biotac calibration show --help`")
    if args.i2c is not None:
        if args.chip is None:
            raise InputError(f"--i2c {args.i2c} needs --chip; expected one of {', '.join(KINDS)}")
        with Chip(args.i2c, args.chip) as chip:
            calibration = eeprom.load(chip)
        CALIBRATION.say(args, f"EEPROM {args.i2c}", calibration, whole=True)
    elif Path(args.where).is_file() or args.where.endswith(".json"):
        CALIBRATION.say(args, args.where, file.load(Path(args.where)), whole=True)
    else:
        CALIBRATION.show_board(args, args.where)
