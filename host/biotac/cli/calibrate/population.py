"""biotac calibrate population PORT"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

import numpy as np

import biotac

from ...calibrate import population
from ...errors import InputError
from ...map import file as map_file
from ...map.columns import ELECTRODES
from ...map.population import in_force
from ...wire import messages_gen as wire
from .. import values
from ..outputs import report

NAME = "population"
HELP = "Force of an uncalibrated finger from a map of other fingers: the firmware's, or one made by biotac-lab."
EXAMPLE = "biotac calibrate population /dev/ttyACM0 --finger index --population ours.json --save"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("port", metavar="PORT", help="a board")
    values.add_finger(parser)
    parser.add_argument(
        "--population", metavar="FILE", type=Path, help="a map of other fingers (default: the firmware's own)"
    )
    values.add_save(parser)
    parser.add_argument("--force", action="store_true", help="replace a map that the finger has of its own")


def run(args: argparse.Namespace) -> int:
    """Put the map into force, and print which fingers it is from and how far off it may be."""
    trained = population.load(args.population)
    with biotac.open(args.port) as hand:
        values.check_answers(hand, args.finger)
        own = hand.board.get_map(args.finger)
        if own is not None and not args.force:
            raise InputError(
                f"finger {args.finger} has a wrench map of its own ({map_file.title(own)}): expected none; keep it by "
                "`biotac calibrate get`, and replace it with --force"
            )
        if args.population is None:
            modelled = {wire.Setting.FORCE_MODEL: wire.ForceModel.POPULATION}
            if not in_force({**hand.board.finger_settings().get(args.finger, hand.board.settings()), **modelled}):
                raise InputError(
                    f"finger {args.finger} has force gains of its own, which go before the map: expected the default "
                    "ones; `biotac calibrate clear` removes a finger's, and the board's are the settings "
                    "force_gain_x_nn to _z_nn"
                )
            if own is not None:
                hand.board.clear_map(args.finger)
            hand.board.set_setting(wire.Setting.FORCE_MODEL, wire.ForceModel.POPULATION)
        else:
            # the board subtracts the tare in force: any will do here
            fitted = trained.population.wrench_map(np.zeros(ELECTRODES))
            hand.board.set_map(args.finger, fitted.on_board(made_s=int(time.time())))
        if args.save:
            hand.board.save_settings()
    facts = {"finger": args.finger, "made_of": trained.fingers, "sigma_n": trained.sigma_n.tolist(), "saved": args.save}
    sigma = "  ".join(f"{value:.2f}" for value in trained.sigma_n)
    text = f"finger {args.finger}: map of {trained.fingers}, in force, {values.how_long(args)}"
    report(args, facts, f"{text}\n  one sigma along x, y, z: {sigma} N")
    return 0
