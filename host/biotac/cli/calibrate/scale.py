"""biotac calibrate scale PORT|REC"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

import biotac

from ...calibrate.population import keeping, presses
from ...calibrate.pressure.presses import Phase, Step
from ...calibrate.wrench import board, fitted, provenance
from ...calibrate.wrench.upload import upload
from ...errors import InputError
from ...hand.hand import Hand
from ...partial_file import whole
from ...wire.identity import ascii_text
from .. import values
from ..recordings.loading import load
from .typed import reading_n

NAME = "scale"
HELP = "A finger's own force from presses on a kitchen scale: the population map with its gain and balance."
EXAMPLE = "biotac calibrate scale sim:fingers.toml --finger index --presses 3"
WHY = "no better than the population map, or a finger unlike those; tare, press its pad flat, firm and straight"
NEWTONS = {"N": 1.0, "g": 9.80665e-3, "kg": 9.80665}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Which finger, how many presses, and where the map goes."""
    parser.add_argument("where", metavar="PORT|REC", help="a board, or a recording (.mcap) of such presses")
    parser.add_argument("--finger", metavar="NAME", type=values.finger, required=True, help="name or chip select")
    parser.add_argument(
        "--presses", metavar="N", type=int, default=5, help="how many (default %(default)s; 20 are better)"
    )
    parser.add_argument(
        "--readings", metavar="X,X,X", type=_numbers, help="what the scale showed at each, of a recording"
    )
    parser.add_argument("--unit", choices=list(NEWTONS), default="N", help="of the readings (default %(default)s)")
    parser.add_argument("--population", metavar="FILE", type=Path, help="another map than the package's own")
    parser.add_argument("--out", metavar="FILE", type=Path, help="the finger's map goes here (.wrench.json)")
    parser.add_argument("--no-upload", action="store_true", help="leave the board as it is")
    parser.add_argument("--save", action="store_true", help="have the board keep the map over a restart")
    parser.add_argument("--force", action="store_true", help="overwrite what is there; upload what is not worth it")


def run(args: argparse.Namespace) -> int:
    """Press, fit, say what it is worth; then, and only if it is worth it, onto the board."""
    finger = args.finger
    kept = keeping.load(args.population)
    if args.out is not None and args.out.exists() and not args.force:
        raise InputError(f"{args.out} exists and would be overwritten; choose another name or say --force")
    if Path(args.where).is_file() or args.where.endswith(".mcap"):
        if args.readings is None or args.save:
            raise InputError("a recording: expected --readings, one a press, and no --save; that is for boards")
        recording = load(Path(args.where))
        shown = [value * NEWTONS[args.unit] for value in args.readings]
        serial = next((ascii_text(its.serial) for its in recording.sensors if its.finger == finger), "")
        return _tell(args, kept, presses.recorded(recording, finger, shown), serial, None, finger)
    with biotac.open(args.where) as hand:
        if finger not in hand.fingers:
            raise InputError(f"finger {finger} does not answer: expected one of {hand.fingers}; see to its cable")
        if hand.link.source is None and not sys.stdin.isatty():
            raise InputError(f"{args.where} tells no force, and nobody is at the keyboard to type it; use a terminal")
        held = presses.guided(hand, finger, args.presses, _Terminal(NEWTONS[args.unit], args.unit))
        return _tell(args, kept, held, ascii_text(hand.sensor_info(finger).serial), hand, finger)


class _Terminal:
    """The guide on stderr, so that stdout is the result's alone."""

    def __init__(self, newtons: float, unit: str) -> None:
        self._newtons, self._unit = newtons, unit

    def show(self, step: Step | None) -> None:
        """See guided.Face."""
        if step is not None:
            words = {
                Phase.REST: "let go, and leave it alone",
                Phase.PRESS: f"press {step.press} of {step.presses}: the pad straight down on the scale, about "
                f"{step.force_n / self._newtons:.0f} {self._unit}, another place each time; hold still",
                Phase.RELEASE: "held: remember what the scale shows, then let go",
            }
            print(f"biotac: {words[step.phase]}", file=sys.stderr)

    def force_n(self, step: Step) -> float:
        """See guided.Face."""
        return reading_n(f"press {step.press}", self._unit, self._newtons)


def _tell(
    args: argparse.Namespace, kept: keeping.Kept, held: presses.Held, serial: str, hand: Hand | None, finger: int
) -> int:
    its = presses.found(kept.its, held)
    own = its.scale.on(kept.its).wrench_map(held.tare)
    made_s = int(time.time())
    facts: dict[str, Any] = {
        "finger": finger,
        "serial": serial,
        "presses": len(held.shown_n),
        "shown_n": held.shown_n.tolist(),
        "gain": its.scale.gain,
        "balance": its.scale.balance,
        "before_n": its.before_n.tolist(),
        "held_out_n": its.held_out_n.tolist(),
        "worth_it": its.worth_it(kept.sigma_scale5_n),
        "sigma_n": kept.sigma_scale5_n.tolist(),
        "fixed_point": board.summary(own, held.run(args.where)),
    }
    if args.out is not None:
        origin = provenance.Provenance(
            serial, made_s, kept.provenance.get("software", ""), (args.where,), "",
            f"{len(held.shown_n)} presses on a scale; population map of {', '.join(kept.provenance.get('files', {}))}",
        )  # fmt: skip
        with whole(args.out, overwrite=args.force) as place:
            place.write_text(provenance.embed(fitted.dumps(own), origin), encoding="utf-8")
        facts["written"] = str(args.out)
    if hand is not None and not args.no_upload and (facts["worth_it"] or args.force):
        facts["board"] = upload(hand, finger, own, held.run(args.where), serial=serial, made_s=made_s).facts()
        if args.save:
            hand.save_settings()
    print(json.dumps(facts) if args.json else "\n".join(_lines(facts)))
    return 0


def _lines(facts: dict[str, Any]) -> list[str]:
    def numbers(values: list[float]) -> str:
        return "  ".join(f"{value:5.2f}" for value in values)

    return [
        f"finger {facts['finger']}, {facts['presses']} presses: gain of z {facts['gain']:.3f}, balance "
        f"{facts['balance']:+.3f} N/N",
        f"  error along x and z before:   {numbers(facts['before_n'])} N",
        f"  of each press by the others:  {numbers(facts['held_out_n'])} N",
        f"  one sigma, x y z, with shear: {numbers(facts['sigma_n'])} N",
        *([] if facts["worth_it"] else [f"  not worth having: {WHY}"]),
        *([f"  written: {facts['written']}"] if "written" in facts else []),
        "  on the board until it restarts (--save keeps it)" if "board" in facts else "  the board is as it was",
    ]


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(float(part) for part in text.split(","))
