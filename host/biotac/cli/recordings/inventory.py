"""biotac inventory DIR"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .lake import room

EXAMPLE = "biotac inventory trials.lake"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the lake."""
    parser.add_argument("folder", metavar="DIR", type=Path, help="a lake, as `biotac export --lake` makes it")


def run(args: argparse.Namespace) -> int:
    """Print the inventory and keep it in the lake; return 1 if a sensor is not as it used to be."""
    lake = room("folder").opened(args.folder)
    inventory = room("inventory")
    its = inventory.take(lake)
    path = inventory.keep(lake, its)
    if args.json:
        print(json.dumps(asdict(its)))
    else:
        for board in its.boards:
            print(
                f"board {board.board}: firmware {board.firmware}, {board.recordings} recordings, {board.hours:.2f} h, "
                f"{inventory.day(board.first_ns)} to {inventory.day(board.last_ns)}, {board.frames_lost} frames lost"
            )
        for sensor in its.sensors:
            print(as_line(sensor, inventory))
        print(f"kept in {path}")
    return 1 if any(sensor.findings for sensor in its.sensors) else 0


def as_line(its: Any, inventory: Any) -> str:
    """A sensor as one line for people."""
    name = its.sensor or "without a serial number"
    calibration = "not calibrated"
    if its.calibration is not None:
        made = f" of {inventory.day(its.calibration_made_ns)}" if its.calibration_made_ns is not None else ""
        calibration = f"calibration {its.calibration}{made}"
    known = {"noise": its.noise_count, "drift": its.drift_count}
    measured = [f"{what} {value:.1f} counts" for what, value in known.items() if value is not None]
    health = "; ".join(its.findings) or ("as usual" if its.recordings > inventory.ENOUGH else "no history yet")
    words = [
        f"{its.recordings} recordings",
        f"{its.hours:.2f} h, last {inventory.day(its.last_ns)}",
        calibration,
        *measured,
    ]
    return f"sensor {name} on {its.board}, finger {its.finger}: {', '.join(words)}: {health}"
