"""biotac lsl PORT"""

from __future__ import annotations

import argparse
import json
import sys

import biotac

from .. import values

EXAMPLE = "biotac lsl 'sim:press.toml?fingers=2'"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add port and time."""
    values.add_port(parser)
    parser.add_argument("--seconds", type=values.seconds, help="device time (default: until Ctrl-C)")


def run(args: argparse.Namespace) -> int:
    """Publish until the time is over, the source ends or Ctrl-C."""
    from ...bridges.lsl import Outlet  # here, because other verbs need no liblsl

    with biotac.open(args.port, pace=1.0) as hand, Outlet(hand) as outlet:
        hand.stream("results", "events")
        streams = [{"name": info.name(), "rate_hz": info.nominal_srate()} for info in outlet.infos]
        if args.json:
            print(json.dumps({"streams": streams}))
        else:
            for stream in streams:
                rate = f"{stream['rate_hz']:g} samples per second" if stream["rate_hz"] else "irregular"
                print(f"{stream['name']}, {rate}")
            if args.seconds is None:
                print("Ctrl-C stops", file=sys.stderr)
        sys.stdout.flush()
        end_us: float | None = None
        try:
            for batch in hand.batches():
                outlet.push(batch)
                last_us = batch.last_t_us()
                if args.seconds is None or last_us is None:
                    continue
                end_us = last_us + args.seconds * 1e6 if end_us is None else end_us
                if last_us >= end_us:
                    break
        except KeyboardInterrupt:
            pass  # the usual way to stop it
        if outlet.by_arrival:
            print(
                f"biotac: {outlet.by_arrival} sample(s) stamped by arrival time: board clock unknown", file=sys.stderr
            )
        if hand.stats.frames_lost:
            print(f"biotac: {hand.stats.frames_lost} frame(s) lost; close other programs", file=sys.stderr)
    return 0
