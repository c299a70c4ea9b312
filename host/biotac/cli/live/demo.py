"""biotac demo"""

from __future__ import annotations

import argparse
from pathlib import Path

from ...demo.answers import NAMES, OWN, POPULATION
from ...demo.run import run_demo
from ...recording.felt import table
from .. import values
from ..outputs import report
from ..progress import Progress

EXAMPLE = "biotac demo press.toml --out my-demo"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "source", metavar="SOURCE", nargs="?", default="press.toml", help="scenario or recorded counts (press.toml)"
    )
    parser.add_argument("--seconds", type=values.seconds, help="device time (default: the source's length)")
    parser.add_argument("--fingers", type=int, help="how many fingers play it, 1 to 5")
    parser.add_argument("--out", type=Path, default=Path("biotac-demo"), help="folder for its output")


def run(args: argparse.Namespace) -> int:
    """Return 0 if everything arrived and every result is within its bound, else 1."""
    source = args.source.removeprefix("sim:")
    with Progress() as progress:
        demo = run_demo(source, args.out, fingers=args.fingers, seconds=args.seconds, show=progress.show)
    facts, check = demo.facts, demo.facts["crosscheck"]
    made = ["calibrated as `biotac calibrate wrench --live` does"] if OWN in demo.felt else []
    skipped = f"{facts['rows_skipped']} incomplete row(s) of the recording skipped"
    asked = f"{facts['rounds_unsampled']} round(s) without a frame: the board asked a sensor for its serial number"
    lines = [
        f"{facts['source']}: {facts['frames']} frames, fingers: {facts['fingers']}, {facts['frames_lost']} lost, "
        f"{facts['crc_errors']} CRC errors; host CPU {facts['host_cpu_percent']} % of one core",
        f"on-board against float64: PoC {check['poc_um_max']:.3f} um, force {check['force_mn_max']:.4f} mN, "
        f"torque {check['torque_nmm_max']:.5f} N*mm at most; {check['violations']} violation(s)",
        f"recording {facts['recording']}, of the board, {NAMES[POPULATION]}; report {facts['report']}",
        f"picture {facts['picture']}",
        *([skipped] if facts["rows_skipped"] else []),
        *([asked] if facts["rounds_unsampled"] else []),
        *made,
        *table({NAMES[name]: felt for name, felt in demo.felt.items()}),
    ]
    report(args, facts, "\n".join(lines))
    return 0 if demo.good else 1
