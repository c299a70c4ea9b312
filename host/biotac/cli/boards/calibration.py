"""biotac calibrate show, get, put and clear: a finger's calibration or map on a board, in a file or in an EEPROM."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import biotac
from biotac import Calibration, Hand

from ...documents import DOUBT, JSON_BYTES, made_text, parse_json, read_text, write_new
from ...errors import InputError
from ...hand.configuration import Configuration
from ...keep import calibration_file, eeprom
from ...keep.chip import Chip, parse_chip
from ...map import file as map_file
from ...version import __version__
from ...wire.identity import serial_text, setting_text
from ...wire.sensor_gen import MAX_SENSORS
from .. import values
from ..outputs import report
from ..recordings.loading import is_named_as_recording

EEPROM = "i2c:"
IN_EEPROM = f"{EEPROM}BUS:ADDRESS:CHIP"


@dataclass(frozen=True)
class StoredKind:
    """A kind of calibration on a board: its name, file module, functions of ``Hand.board`` and texts.

    ``write`` gets true last if any sensor will do; ``lines`` print the content.
    """

    name: str
    file: ModuleType
    read: Callable[[Configuration, int], Any]  # None if the finger has none
    state: Callable[[Configuration, int], biotac.CalibrationState]
    write: Callable[[Configuration, int, Any, bool], object]
    remove: Callable[[Configuration, int], object]
    title: Callable[[Any], str]
    lines: Callable[[Any], list[str]] = lambda content: []


def _write_calibration(board: Configuration, finger: int, calibration: Calibration, force: bool) -> None:
    board.set_calibration(finger, replace(calibration, serial="") if force else calibration)


def _title(calibration: Calibration) -> str:
    sensor = f"sensor {calibration.serial}" if calibration.serial else "any sensor"
    return f"for {sensor}, {made_text(calibration.made_s)}"


KINDS = {
    "calibration": StoredKind(
        "calibration", calibration_file, Configuration.calibration, Configuration.calibration_state,
        _write_calibration, Configuration.clear_calibration, _title,
        lambda content: [f"  {setting_text(setting, value)}" for setting, value in content.settings().items()],
    ),
    "map": StoredKind(
        "wrench map", map_file, Configuration.get_map, Configuration.map_state,
        lambda board, finger, blob, force: board.set_map(finger, blob, force=force),
        Configuration.clear_map, map_file.title,
    ),
}  # fmt: skip


def add_subverbs(verbs: Any) -> None:
    """Add them to the verbs of ``biotac calibrate``."""

    def add(name: str, action: Callable[..., int], text: str, example: str) -> argparse.ArgumentParser:
        return values.add_subverb(verbs, name, action, text, f"biotac calibrate {name} {example}")

    which = f"an EEPROM, for one calibration, is {EEPROM}1:0x50:24c32, for example"
    show = add("show", _show, "Print what a board, a recording, a file or an EEPROM holds.", "index.json")
    show.add_argument("where", metavar=f"PORT|REC|FILE|{IN_EEPROM}", help=which)

    get = add(
        "get", _get, "Copy from a board, recording or EEPROM to a file.", "/dev/ttyACM0 --finger index index.json"
    )
    get.add_argument("where", metavar=f"PORT|REC|{IN_EEPROM}", help=which)
    get.add_argument("file", metavar="FILE", type=Path, help="- is standard output")
    get.add_argument("--force", action="store_true", help="overwrite FILE")

    put = add("put", _put, "Copy from a file to a board or an EEPROM.", "/dev/ttyACM0 index.json --finger index --save")
    put.add_argument("where", metavar=f"PORT|{IN_EEPROM}", help=which)
    put.add_argument("file", metavar="FILE", type=Path, help="- is standard input")
    put.add_argument("--force", action="store_true", help="accept another sensor, and a file marked as not worth using")

    clear = add("clear", _clear, "Return to the board's settings.", "/dev/ttyACM0 --finger index --save")
    clear.add_argument("where", metavar="PORT")
    for subverb in (get, put, clear):
        values.add_finger(subverb, required=subverb is clear, text="name or chip select, of a board")
    for subverb in (get, clear):
        subverb.add_argument("--kind", choices=KINDS, help="which of the two, for a finger that has both")
    for subverb in (put, clear):
        values.add_save(subverb)


def _show(args: argparse.Namespace) -> int:
    is_file = args.where.endswith(".json") or (Path(args.where).is_file() and _port(args.where) == args.where)
    if is_file or args.where.startswith(EEPROM):
        kind, content = _load(Path(args.where))[:2] if is_file else (KINDS["calibration"], _in_eeprom(args.where))
        lines = [f"{args.where}: {kind.title(content)}", *kind.lines(content)]
        report(args, kind.file.to_dict(content), "\n".join(lines))
        return 0
    facts: dict[int, dict[str, Any]] = {}
    lines = []
    with biotac.open(_port(args.where)) as hand:
        for finger in range(MAX_SENSORS):
            facts[finger], before = {}, len(lines)
            for name, kind in KINDS.items():
                state, content = kind.state(hand.board, finger), kind.read(hand.board, finger)
                facts[finger][name] = {"state": state.name, **(kind.file.to_dict(content) if content else {})}
                if content is not None:
                    in_force = state == biotac.CalibrationState.IN_FORCE
                    force = "in force" if in_force else "not in force, a different sensor is connected"
                    lines += [f"finger {finger}: {kind.name} {force}; {kind.title(content)}", *kind.lines(content)]
            if finger in hand.fingers and len(lines) == before:
                lines.append(f"finger {finger}: none, the board's settings apply")
    report(args, facts, "\n".join(lines))
    return 0


def _get(args: argparse.Namespace) -> int:
    if args.where.startswith(EEPROM):
        had, board = [(KINDS["calibration"], _in_eeprom(args.where))], {"from": args.where}
    else:
        _check_named(args)
        with biotac.open(_port(args.where)) as hand:
            had = _had(args, hand)
            board = {"from": args.where, "board_serial": serial_text(hand.info), "finger": args.finger}
    if not had:
        missing = KINDS[args.kind].name if args.kind else "calibration and no wrench map"
        cure = "the recording has none" if _port(args.where).startswith("replay:") else "upload one with `put`"
        raise InputError(f"finger {args.finger} on {args.where} has no {missing}; {cure}")
    ((kind, content),) = had
    text = kind.file.dumps(content, {"software": f"biotac-gateway {__version__}", **board})
    if str(args.file) == "-":
        print(text, end="")
        return 0
    write_new(args.file, text, overwrite=args.force)
    report(args, kind.file.to_dict(content), f"{args.file}: {kind.title(content)}")
    return 0


def _put(args: argparse.Namespace) -> int:
    kind, content, doubt = _load(args.file)
    if doubt and not args.force:
        raise InputError(
            f"{args.file} is not worth using: {doubt}; calibrate again, or put it all the same with --force"
        )
    if args.where.startswith(EEPROM):
        if kind is not KINDS["calibration"]:
            raise InputError(f"{args.file} is a {kind.name}, which no EEPROM holds; expected a calibration")
        with Chip(*parse_chip(args.where.removeprefix(EEPROM))) as chip:
            more = "stored" if eeprom.store(chip, content) else "which it held already"
        report(args, kind.file.to_dict(content), f"{args.where}: {kind.title(content)}, {more}")
        return 0
    _check_named(args)
    with biotac.open(args.where) as hand:
        kind.write(hand.board, args.finger, content, args.force)
        content = kind.read(hand.board, args.finger) or content
        if args.save:
            hand.board.save_settings()
    text = f"finger {args.finger}: {kind.name} in force, {values.how_long(args)}; {kind.title(content)}"
    report(args, kind.file.to_dict(content), text)
    return 0


def _clear(args: argparse.Namespace) -> int:
    with biotac.open(args.where) as hand:
        for kind, _ in _had(args, hand):
            kind.remove(hand.board, args.finger)
        if args.save:
            hand.board.save_settings()
    report(args, {"finger": args.finger}, f"finger {args.finger}: the board's settings apply, {values.how_long(args)}")
    return 0


def _had(args: argparse.Namespace, hand: Hand) -> list[tuple[StoredKind, Any]]:
    """The finger's calibration or map. Raises InputError if it has both and neither is named."""
    kinds = [KINDS[args.kind]] if args.kind else KINDS.values()
    had = [(kind, content) for kind in kinds if (content := kind.read(hand.board, args.finger)) is not None]
    if len(had) > 1:
        both = " or ".join(KINDS)
        raise InputError(f"finger {args.finger} has a calibration and a wrench map; name one: --kind {both}")
    return had


def _check_named(args: argparse.Namespace) -> None:
    if args.finger is None:
        raise InputError(f"{args.where} has several fingers; name one with --finger")


def _in_eeprom(where: str) -> Calibration:
    with Chip(*parse_chip(where.removeprefix(EEPROM))) as chip:
        return eeprom.load(chip)


def _port(where: str) -> str:
    return f"replay:{where}" if is_named_as_recording(where) else where


def _load(path: Path) -> tuple[StoredKind, Any, str]:
    """A file's kind by its format, the content, and why that is not worth using."""
    piped = str(path) == "-"
    try:
        text = sys.stdin.read() if piped else read_text(path, JSON_BYTES)
        tree = parse_json(text)
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); check the path") from error
    except ValueError as error:
        raise InputError(f"{path} is not usable: {error}; expected JSON of `biotac calibrate get`") from error
    seen = tree.get("format") if isinstance(tree, dict) else None
    for kind in KINDS.values():
        if seen == kind.file.FORMAT:
            content = kind.file.loads(text, "standard input" if piped else str(path))
            made = tree.get("provenance")
            return kind, content, str(made.get(DOUBT, "")) if isinstance(made, dict) else ""
    formats = " or ".join(f'"{kind.file.FORMAT}"' for kind in KINDS.values())
    raise InputError(
        f'{path} is not usable: it has "format": {json.dumps(seen)}, expected {formats}, as `biotac calibrate get` '
        "and `biotac calibrate` write it"
    )
