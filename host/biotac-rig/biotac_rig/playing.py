"""biotac sim SOURCE --sensor-port PORT"""

from __future__ import annotations

import argparse
import sys
import time
from contextlib import closing
from dataclasses import asdict

from biotac.cli.live.sim import NO_FAULT, fault_of
from biotac.cli.outputs import report
from biotac.errors import InputError
from biotac.link import open_link
from biotac.sim.fault_gen import EmuFault
from biotac.sim.faults import BUS_FAULTS
from biotac.sim.loading import load_source
from biotac.sim.play import with_fault
from biotac.wire.sensor_gen import SLOT_HZ, SLOTS

from . import emu_gen as emu
from .sensor_board import SensorBoard

LOOK_S = 0.5


def run(args: argparse.Namespace, length_s: float | None) -> int:
    """Plug the sensors in, feed them until the tape ends or Ctrl-C, and print the board's status."""
    faults = [fault_of(text) for text in args.fault]
    on_bus = [(finger, kind) for finger, kind, _ in faults if kind in BUS_FAULTS or kind == NO_FAULT]
    if args.source is None and len(on_bus) < len(faults):
        known = ", ".join((NO_FAULT, *BUS_FAULTS))
        raise InputError(f"without a SOURCE, a sensor board's faults are those of the bus: {known}; add one")
    if args.source is None and (args.keep or args.by_time):
        raise InputError(f"{'--keep' if args.keep else '--by-time'} needs a SOURCE, such as press.toml")
    with closing(SensorBoard(open_link(args.sensor_port))) as board:
        if args.source is not None:
            seconds = args.seconds if args.keep else length_s  # a loop repeats by itself
            source = load_source(args.source.removeprefix("sim:"), fingers=args.fingers, seconds=seconds)
            for finger, kind, channel in faults:
                source = source if (finger, kind) in on_bus else with_fault(source, finger, kind, channel)
            board.plug(source)
            board.play(by_time=args.by_time)
        if args.forget:
            board.forget()
        for finger, kind in on_bus:
            board.fault(finger, BUS_FAULTS.get(kind, EmuFault.NONE))
        status = board.keep() if args.keep else board.status() if args.source is None else play(board)
    report(args, asdict(status), summary(status))
    return 0


def play(board: SensorBoard) -> emu.EmuStatus:
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


def summary(status: emu.EmuStatus) -> str:
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
        change = "skipped" if status.rounds_moved > 0 else "repeated"
        lines.append(f"{abs(status.rounds_moved)} rounds of 10 ms were {change} to keep the tape on its clock")
    if status.loop_slots:
        now = "playing now" if status.looping else "played from the next power-up"
        lines.append(f"{status.loop_slots / SLOT_HZ:.2f} s stored in its flash, {now}")
    return "\n".join(lines)
