"""What `biotac calibration` and `biotac map` share: the subverbs get, put, clear and show."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import biotac

from ...errors import InputError
from ...version import __version__
from ...wire.identity import serial_text
from ...wire.sensor_gen import MAX_SENSORS
from .. import values

Hand = biotac.Hand


def add(what: Any, verb: str, name: str, action: Any, text: str, example: str) -> argparse.ArgumentParser:
    """Add ``name`` to ``what``, the subparsers of ``verb``; ``example`` is a call without its leading "biotac VERB"."""
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


def add_finger(parser: argparse.ArgumentParser) -> None:
    """Add --finger; it has no default, because nobody would notice a wrong one."""
    parser.add_argument("--finger", metavar="NAME", type=values.finger, required=True, help="name or chip select")


def add_save(parser: argparse.ArgumentParser) -> None:
    """Add --save."""
    parser.add_argument(
        "--save",
        action="store_true",
        help="save it on the board, with all current settings, so that it survives a restart",
    )


@dataclass(frozen=True)
class Kept:
    """Something that a board keeps for a finger: its name, its file module, the Hand's functions for it, its texts.

    ``write`` gets true last if any sensor will do; ``lines`` tell the content.
    """

    name: str
    file: ModuleType
    read: Callable[[Hand, int], Any]  # None if the finger has none
    state: Callable[[Hand, int], biotac.CalibrationState]
    write: Callable[[Hand, int, Any, bool], object]
    remove: Callable[[Hand, int], object]
    title: Callable[[Any], str]
    lines: Callable[[Any], list[str]] = lambda its: []

    def add(self, add: Any, cleared: str, get_port_help: str | None = None) -> None:
        """Add get, put and clear; ``cleared`` is the help text of clear."""
        parser = add("get", self.get, "From a board into a file.", "get /dev/ttyACM0 --finger index index.json")
        parser.add_argument("port", metavar="PORT", help=get_port_help)
        parser.add_argument("file", metavar="FILE", type=Path)
        parser.add_argument("--force", action="store_true", help="overwrite FILE")
        add_finger(parser)

        parser = add("put", self.put, "From a file to a board.", "put /dev/ttyACM0 index.json --finger index --save")
        parser.add_argument("port", metavar="PORT")
        parser.add_argument("file", metavar="FILE", type=Path)
        parser.add_argument("--force", action="store_true", help="accept a sensor other than the file's")
        add_finger(parser)
        add_save(parser)

        parser = add("clear", self.clear, cleared, "clear /dev/ttyACM0 --finger index --save")
        parser.add_argument("port", metavar="PORT")
        add_finger(parser)
        add_save(parser)

    def get(self, args: argparse.Namespace) -> None:
        """Read it from a board into a file."""
        with biotac.open(args.port) as hand:
            its = self.read(hand, args.finger)
            if its is None:
                cure = "the recording has none" if args.port.startswith("replay:") else "upload one with `put`"
                raise InputError(f"finger {args.finger} on {args.port} has no {self.name}; {cure}")
            board = {"from": args.port, "board_serial": serial_text(hand.info), "finger": args.finger}
        self.save(args, its, board)

    def save(self, args: argparse.Namespace, its: Any, source: dict[str, Any]) -> None:
        """Write the file and print what it holds; ``source`` is its origin."""
        provenance = {"software": f"biotac-gateway {__version__}", **source}
        self.file.save(args.file, its, provenance, overwrite=args.force)
        self.say(args, str(args.file), its)

    def put(self, args: argparse.Namespace) -> None:
        """Write it from a file to a board."""
        its = self.file.load(args.file)
        with biotac.open(args.port) as hand:
            self.write(hand, args.finger, its, args.force)
            its = self.read(hand, args.finger) or its
            if args.save:
                hand.save_settings()
        kept = "saved" if args.save else "until the next reboot (--save keeps it)"
        if args.json:
            print(json.dumps(self.file.to_dict(its)))
        else:
            print(f"finger {args.finger}: in force, {kept}; {self.title(its)}")

    def clear(self, args: argparse.Namespace) -> None:
        """Remove it, so that the board's settings apply again."""
        with biotac.open(args.port) as hand:
            self.remove(hand, args.finger)
            if args.save:
                hand.save_settings()
        kept = "saved" if args.save else "until the next reboot (--save keeps it so)"
        print(
            json.dumps({"finger": args.finger})
            if args.json
            else f"finger {args.finger}: the board's settings apply, {kept}"
        )

    def show_board(self, args: argparse.Namespace, port: str) -> None:
        """Print what each finger of a board has."""
        with biotac.open(port) as hand:
            fingers = {f: (self.state(hand, f), self.read(hand, f)) for f in range(MAX_SENSORS)}
            present = hand.fingers
        if args.json:
            told = {f: {"state": s.name, **(self.file.to_dict(its) if its else {})} for f, (s, its) in fingers.items()}
            print(json.dumps(told))
            return
        for finger, (state, its) in fingers.items():
            if its is not None:
                in_force = state == biotac.CalibrationState.IN_FORCE
                words = "in force" if in_force else "not in force, a different sensor is connected"
                print("\n".join([f"finger {finger}: {words}; {self.title(its)}", *self.lines(its)]))
            elif finger in present:
                print(f"finger {finger}: none, the board's settings apply")

    def say(self, args: argparse.Namespace, where: str, its: Any, *, more: str = "", whole: bool = False) -> None:
        """Print what is at ``where``; ``whole`` adds its content."""
        lines = [f"{where}: {self.title(its)}{more}", *(self.lines(its) if whole else [])]
        print(json.dumps(self.file.to_dict(its)) if args.json else "\n".join(lines))


def run(args: argparse.Namespace) -> int:
    """Run the subverb."""
    args.action(args)
    return 0
