"""biotac stream PORT"""

from __future__ import annotations

import argparse
import json
import sys

import biotac

from ...hand.streams import RESULTS
from ...wire.fields import as_json as row_as_json
from ...wire.frames import Frame
from ...wire.messages_gen import FrameFlags
from .. import values

EXAMPLE = "biotac stream sim:press.toml --rate 5"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Port, time and rate."""
    values.add_port(parser)
    parser.add_argument("--seconds", type=values.seconds, help="stop after this much device time")
    parser.add_argument(
        "--rate", type=values.rate, default=10.0, help="lines per second and finger (default 10; 0: all)"
    )
    parser.add_argument(
        "--touched", action="store_true", help="only fingers that are touched; untouched ones send heartbeats"
    )


def run(args: argparse.Namespace) -> int:
    """Print until the time is over, the source ends or Ctrl-C."""
    # A person wants to see it happen: simulated boards run in real time here.
    with biotac.open(args.port, pace=1.0) as hand:
        for warning in hand.warnings:
            print(f"biotac: {warning.text}", file=sys.stderr)
        if args.touched:
            hand.subscribe(RESULTS)
        show(hand, rate=args.rate, seconds=args.seconds, as_json=args.json)
    return 0


def show(hand: biotac.Hand, *, rate: float, seconds: float | None = None, as_json: bool = False) -> None:
    """Print ``rate`` frames a second and finger, and at the end how many were lost."""
    due_us: dict[int, int] = {}
    step_us = int(1e6 / rate) if rate > 0 else 0
    end_us: int | None = None
    for frame in hand.frames():
        if end_us is None and seconds is not None:
            end_us = frame.t_us + round(seconds * 1e6)
        if end_us is not None and frame.t_us >= end_us:
            break
        if frame.t_us < due_us.get(frame.finger, frame.t_us):
            continue
        due_us[frame.finger] = frame.t_us + step_us
        print(json.dumps(row_as_json(frame)) if as_json else as_line(frame))
        sys.stdout.flush()
    lost = hand.stats.frames_lost
    if lost:
        print(f"biotac: {lost} frame(s) lost; close other programs, or use a faster computer", file=sys.stderr)


def as_line(frame: Frame) -> str:
    """Columns for a person."""
    poc = " ".join(f"{v:7.2f}" for v in frame.poc_mm)
    force = " ".join(f"{v:7.3f}" for v in frame.force_n)
    torque = " ".join(f"{v:8.2f}" for v in frame.torque_nmm)
    flags = "|".join(flag.name or "" for flag in FrameFlags if flag in frame.flags)
    return (
        f"{frame.t_us / 1e6:9.3f} s finger {frame.finger}  poc {poc} mm  force {force} N  torque {torque} N*mm  {flags}"
    )
