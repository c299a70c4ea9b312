"""biotac calibrate weights PORT|REC"""

from __future__ import annotations

import argparse

from ...calibrate.population import fewshot, presses, weights
from ...calibrate.pressure.presses import Step
from ...hand.hand import Hand
from ...recording import Recording
from .. import values
from . import own_map

NAME = "weights"
HELP = "A finger's own force from known weights on its pad, level and tilted: corrects all axes of the population map."
EXAMPLE = "biotac calibrate weights sim:weights.toml --finger index"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the finger, the weights and tilts, and where the map goes."""
    own_map.add_arguments(parser)
    for name, default, metavar, what in (
        ("--masses", weights.MASSES_G, "G,G", "grams"),
        ("--tilts", weights.TILTS_DEG, "DEG,DEG", "degrees of the block"),
    ):
        said = f"{what} (default {','.join(f'{value:g}' for value in default)})"
        parser.add_argument(name, metavar=metavar, type=values.numbers, default=default, help=said)


def run(args: argparse.Namespace) -> int:
    """Guide the loading, fit the map, print its error; upload it only if it helps."""
    loads = weights.plan(args.masses, args.tilts)
    sizes_n, toward = [load.size_n for load in loads], [load.toward for load in loads]

    def press(step: Step) -> str:
        return f"weight {step.press} of {step.presses}: {loads[step.press - 1]}; do not touch it"

    def guide(hand: Hand) -> presses.Held:
        face = own_map.Guide(press, lambda step: sizes_n[step.press - 1], "held: take the weight off")
        return presses.guided(hand, args.finger, sizes_n, face, toward=toward)

    def recorded(recording: Recording) -> presses.Held:
        return presses.recorded(recording, args.finger, sizes_n, toward)

    with own_map.pressed(args, guide, recorded) as its:
        facts = own_map.tell(
            args, its, fewshot.weighed, "weights on tilted blocks", lambda kept: {"force_n": its.held.force_n.tolist()}
        )
        return own_map.show(args, facts, f"{facts['presses']} weights")
