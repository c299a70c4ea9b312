"""biotac record PORT OUT"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import biotac

from .. import values
from ..progress import Progress

EXAMPLE = "biotac record /dev/ttyACM0 grasp.mcap --seconds 30"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Port, file and time."""
    parser.add_argument(
        "port", metavar="PORT", help="device path, spidev:BUS.DEVICE, sim:SOURCE or emu:pico?source=SOURCE"
    )
    parser.add_argument("out", metavar="OUT", type=Path, help="file to write, .mcap")
    parser.add_argument("--seconds", type=values.seconds, help="device time to record (default: until Ctrl-C)")
    parser.add_argument("--force", action="store_true", help="overwrite OUT")


def run(args: argparse.Namespace) -> int:
    """Record until the time is over, the source ends or Ctrl-C; what came until then is kept."""
    progress = Progress()
    first_us: int | None = None
    last_us = 0
    with biotac.open(args.port) as hand:
        hand.record(args.out, overwrite=args.force)
        try:
            for batch in hand.batches():
                if not len(batch.frames):
                    continue
                last_us = int(batch.frames["t_us"][-1])
                first_us = int(batch.frames["t_us"][0]) if first_us is None else first_us
                progress.show(f"{(last_us - first_us) / 1e6:.1f} s, {hand.stats.frames} frames, Ctrl-C stops")
                if args.seconds is not None and last_us - first_us >= args.seconds * 1e6:
                    break
        except KeyboardInterrupt:
            pass  # the usual way to stop a recording
        progress.done()
        stats = hand.stats
    facts = {
        "recording": str(args.out),
        "frames": stats.frames,
        "frames_lost": stats.frames_lost,
        "crc_errors": stats.crc_errors,
        "device_seconds": (last_us - (first_us or 0)) / 1e6,
    }
    if args.json:
        print(json.dumps(facts))
    else:
        print(f"{args.out}: {stats.frames} frames, {stats.frames_lost} lost; `biotac check {args.out}` verifies them")
    return 0
