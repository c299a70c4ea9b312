"""biotac sensor PORT SOURCE"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import asdict

from ...errors import InputError
from ...link import open_link
from ...sim.loading import load_source
from ...sim.sensor_board import SensorBoard
from ...wire import messages_gen as wire
from ...wire.sensor_gen import SLOT_HZ, SLOTS
from .. import values

EXAMPLE = "biotac sensor /dev/ttyACM1 press.toml --fingers 5"
SCENARIO_S = 600.0
LOOK_S = 0.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add port, source and faults."""
    parser.add_argument(
        "port", metavar="PORT", help="device path or serial:NUMBER of the sensor board, not the gateway"
    )
    parser.add_argument(
        "source",
        metavar="SOURCE",
        nargs="?",
        help="scenario (.toml) or recorded counts (.npz, .btd); without one the board goes on with its present tape",
    )
    parser.add_argument("--fingers", type=int, help="how many fingers play it, 1 to 5")
    parser.add_argument(
        "--seconds",
        type=values.seconds,
        help="device time (default: scenarios repeat for ten minutes, recordings play once)",
    )
    parser.add_argument(
        "--by-time",
        action="store_true",
        help="keep the tape to the board's clock: where the gateway's differs, rounds are skipped or repeated",
    )
    kept = parser.add_mutually_exclusive_group()
    kept.add_argument(
        "--keep",
        action="store_true",
        help="keep SOURCE in the board's flash, up to 3.5 s of five fingers: it plays from power-up on, over and over",
    )
    kept.add_argument("--forget", action="store_true", help="erase what --keep has stored")
    kinds = ", ".join(fault.name.lower() for fault in wire.EmuFault)
    parser.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="FINGER=KIND",
        help=f"from now on, whatever the tape says: {kinds}; may be repeated",
    )


def run(args: argparse.Namespace) -> int:
    """Plug the sensors in, feed them until their tape ends or Ctrl-C, and print how the board did."""
    faults = [fault_of(text) for text in args.fault]
    if args.source is None and (args.keep or args.by_time):
        raise InputError(f"{'--keep' if args.keep else '--by-time'} needs a SOURCE, such as press.toml")
    board = SensorBoard(open_link(args.port))
    try:
        if args.source is not None:
            repeats = args.source.endswith(".toml") and not args.keep  # a loop repeats on its own
            seconds = args.seconds or (SCENARIO_S if repeats else None)
            board.plug(load_source(args.source, fingers=args.fingers, seconds=seconds))
            board.play(by_time=args.by_time)
        if args.forget:
            board.forget()
        for finger, fault in faults:
            board.fault(finger, fault)
        status = board.keep() if args.keep else board.status() if args.source is None else play(board)
    finally:
        board.close()
    print(json.dumps(asdict(status)) if args.json else summary(status))
    return 0


def play(board: SensorBoard) -> wire.EmuStatus:
    """Feed until the gateway has read past the last slot, or Ctrl-C."""
    try:
        status = board.feed()
        while status.slots_served < status.slots_taken:
            time.sleep(LOOK_S)
            status = board.status()
    except KeyboardInterrupt:
        print("stopped; the board keeps playing what it has", file=sys.stderr)
        status = board.status()
    return status


def fault_of(text: str) -> tuple[int, wire.EmuFault]:
    """Finger and fault of a text such as ``2=stuck_low``."""
    finger, _, kind = text.partition("=")
    if not finger.isdigit() or kind.upper() not in wire.EmuFault.__members__:
        kinds = ", ".join(fault.name.lower() for fault in wire.EmuFault)
        raise InputError(f"--fault {text}: expected FINGER=KIND, as in 2=stuck_low; kinds are {kinds}")
    return int(finger), wire.EmuFault[kind.upper()]


def summary(status: wire.EmuStatus) -> str:
    """The status for people. If the gateway lost no slot, the tape's time less this board's is the clocks' drift."""
    lines = [
        f"{status.slots_served} of {status.slots_taken} slots served in {status.elapsed_us / 1e6:.3f} s by its clock; "
        f"{status.words} words read, {status.words_late} late, {status.samples_starved} requested but missing",
        f"the slowest answer was ready {status.slowest_us} us after its select rose",
    ]
    if status.slots_served > 1 and status.elapsed_us:
        tape_us = (status.slots_served - 1 - status.rounds_moved * len(SLOTS)) * 1e6 / SLOT_HZ
        lines.append(
            f"the gateway's clock is {(status.elapsed_us / tape_us - 1) * 1e6:+.0f} ppm slow against this board's"
        )
    if status.rounds_moved:
        what = "skipped" if status.rounds_moved > 0 else "repeated"
        lines.append(f"{abs(status.rounds_moved)} rounds of 10 ms were {what} to keep the tape on its clock")
    if status.loop_slots:
        now = "playing now" if status.looping else "played from the next power-up"
        lines.append(f"{status.loop_slots / SLOT_HZ:.2f} s stored in its flash, {now}")
    return "\n".join(lines)
