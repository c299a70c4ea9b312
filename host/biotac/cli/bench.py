"""biotac bench WHAT"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict

from ..bench import batch

NAME = "bench"
HELP = "Measure how fast the maths is, against NumPy, in one run."
EXAMPLE = "biotac bench batch"
MAX_FRAMES = 10_000_000  # NumPy's contestants take half a kilobyte of memory per frame


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What, and how much of it."""
    parser.add_argument("what", metavar="WHAT", choices=["batch"], help="batch: whole recordings, biotac.compute")
    parser.add_argument(
        "--frames", type=_frames, default=200_000, metavar="N", help="recording length (default %(default)s)"
    )


def _frames(text: str) -> int:
    frames = int(text)
    if not batch.SINGLE_FRAMES <= frames <= MAX_FRAMES:
        raise argparse.ArgumentTypeError(f"{frames} frames, expected {batch.SINGLE_FRAMES} to {MAX_FRAMES}")
    return frames


def run(args: argparse.Namespace) -> int:
    """Print and return 0, whatever the ratios are: they are for people to judge."""
    outcome = batch.measure(args.frames)
    if args.json:
        print(json.dumps(asdict(outcome)))
        return 0
    width = max(len(row.name) for row in outcome.rows)
    print(f"{'ns per frame':{width}}  {'median':>9} {'min':>9} {'max':>9}")
    for row in outcome.rows:
        print(f"{row.name:{width}}  {row.median_ns:9.1f} {row.min_ns:9.1f} {row.max_ns:9.1f}")
    print(
        f"{outcome.frames} frames, {batch.ROUNDS} interleaved rounds; NumPy's best block here: {outcome.block} frames"
    )
    for ratio in outcome.ratios:
        print(f"{ratio.ratio:5.1f}x  {ratio.faster} against {ratio.slower}{_verdict(ratio)}")
    return 0


def _verdict(ratio: batch.Ratio) -> str:
    if ratio.asked is None:
        return ""
    return f" (asked {ratio.asked:.0f}x: {'met' if ratio.ratio >= ratio.asked else 'NOT met'})"
