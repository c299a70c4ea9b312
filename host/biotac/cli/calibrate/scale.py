"""biotac calibrate scale PORT|REC"""

from __future__ import annotations

import argparse
import sys
from contextlib import ExitStack
from typing import Any

from ...calibrate.population import fewshot, population_map, presses
from ...calibrate.pressure.force_source import Truth
from ...calibrate.pressure.presses import Step
from ...calibrate.reference.scale import UNITS_N, Scale
from ...errors import InputError
from ...hand.hand import Hand
from ...recording import Recording
from .. import values
from . import own_map
from .typed_readings import reading_n

NAME = "scale"
HELP = "A finger's own force from presses on a kitchen scale: the population map with its gain and balance."
EXAMPLE = "biotac calibrate scale sim:fingers.toml --finger index --presses 3"
HELD = "held: let go"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the finger, the number of presses, the scale's unit, and where the map goes."""
    own_map.add_arguments(parser)
    parser.add_argument(
        "--presses", metavar="N", type=int, default=5, help="how many (default %(default)s; 20 are better)"
    )
    parser.add_argument(
        "--scale", metavar="PORT", help="read the scale from a serial port: MT-SICS or A&D, ?baud=9600&parity=N&bits=8"
    )
    parser.add_argument(
        "--readings", metavar="X,X,X", type=values.numbers, help="the scale's reading at each press, for a recording"
    )
    parser.add_argument("--unit", choices=list(UNITS_N), default="N", help="of the readings (default %(default)s)")


def run(args: argparse.Namespace) -> int:
    """Guide the presses, fit the map, print its error; upload it only if it helps."""
    newtons = UNITS_N[args.unit]

    def press(step: Step) -> str:
        return (
            f"press {step.press} of {step.presses}: push the pad straight down on the scale with "
            f"about {step.force_n / newtons:.0f} {args.unit}, in a new place each time; hold still until told"
        )

    def guide(hand: Hand) -> presses.Held:
        source = hand.link.source
        with ExitStack() as stack:
            if args.scale is not None:
                scale = stack.enter_context(Scale(args.scale))
                face = own_map.Guide(press, lambda step: scale.force_n(), HELD)
            else:
                if source is None and not sys.stdin.isatty():
                    raise InputError(
                        f"{args.where} gives no force, and stdin is not a terminal to type it in; use a terminal, or "
                        "--scale PORT"
                    )
                face = own_map.Guide(press, lambda step: reading_n(f"press {step.press}", args.unit, newtons), HELD)
            truth = None if source is None or args.scale is not None else Truth(source)
            return presses.guided(hand, args.finger, presses.asked_n(args.presses), face, truth=truth)

    def recorded(recording: Recording) -> presses.Held:
        if args.readings is None:
            raise InputError("a recording does not hold what the scale showed: expected --readings, one per press")
        return presses.recorded(recording, args.finger, [value * newtons for value in args.readings])

    with own_map.pressed(args, guide, recorded) as its:

        def more(trained: population_map.Trained) -> dict[str, Any]:
            scale = fewshot.scale_of(its.held.columns @ trained.population.coefficients, its.held.force_n[:, 2])
            return {"shown_n": its.held.force_n[:, 2].tolist(), "gain": scale.gain, "balance": scale.balance}

        facts = own_map.tell(args, its, fewshot.scaled, "presses on a scale", more)
        words = f"{facts['presses']} presses: z gain {facts['gain']:.3f}, balance {facts['balance']:+.3f} N/N"
        return own_map.show(args, facts, words)
