"""biotac record PORT OUT"""

from __future__ import annotations

import argparse
import json
from contextlib import ExitStack, suppress
from pathlib import Path

import biotac

from .. import values
from ..progress import Progress
from .table import LiveTable, is_possible

EXAMPLE = "biotac record /dev/ttyACM0 grasp.mcap --seconds 30"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add port, file and time."""
    parser.add_argument(
        "port", metavar="PORT", help="device path, spidev:BUS.DEVICE, sim:SOURCE or emu:pico?source=SOURCE"
    )
    parser.add_argument("out", metavar="OUT", type=Path, help="file to write, .mcap")
    parser.add_argument(
        "--seconds", type=values.seconds, help="record at least this much device time (default: until Ctrl-C)"
    )
    parser.add_argument("--force", action="store_true", help="overwrite OUT")


def run(args: argparse.Namespace) -> int:
    """Record until the time is over, the source ends or Ctrl-C, and keep what has arrived."""
    progress = Progress(enabled=not is_possible())
    first_us: int | None = None
    last_us = 0
    with biotac.open(args.port) as hand:
        earlier = faults_told(hand)
        recorder = hand.record(args.out, overwrite=args.force)
        table = None
        with ExitStack() as shown, suppress(KeyboardInterrupt):  # the usual way to stop a recording
            if not args.json and is_possible():
                table = shown.enter_context(LiveTable(hand, f"{hand.port} to {args.out}"))
            for batch in hand.batches():
                if not len(batch.frames):
                    continue
                last_us = int(batch.frames["t_us"][-1])
                first_us = int(batch.frames["t_us"][0]) if first_us is None else first_us
                words = f"{(last_us - first_us) / 1e6:.1f} s, {hand.stats.frames} frames"
                progress.show(f"{words}, Ctrl-C stops")
                if table is not None:
                    table.show(f"{words}, {recorder.path.stat().st_size / 1e6:.1f} MB, Ctrl-C stops")
                if args.seconds is not None and last_us - first_us >= args.seconds * 1e6:
                    break
        progress.done()
        stats = hand.stats
        faults = [line for line in faults_told(hand) if line not in earlier]
    facts = {
        "recording": str(args.out),
        "frames": stats.frames,
        "frames_lost": stats.frames_lost,
        "crc_errors": stats.crc_errors,
        "faults": faults,
        "device_seconds": (last_us - (first_us or 0)) / 1e6,
    }
    if args.json:
        print(json.dumps(facts))
    else:
        print(f"{args.out}: {stats.frames} frames, {stats.frames_lost} lost; `biotac check {args.out}` verifies them")
        for fault in faults:
            print(f"fault during the recording: {fault}")
    return 0


def faults_told(hand: biotac.Hand) -> list[str]:
    """The board's latched faults, a line each; none for firmware that latches none."""
    with suppress(biotac.WireVersionError):
        return str(hand.faults()).splitlines()
    return []
