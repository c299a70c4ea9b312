"""biotac record PORT OUT"""

from __future__ import annotations

import argparse
from contextlib import suppress
from pathlib import Path
from typing import Any

import biotac

from ...recording.felt import Felt, table
from .. import ending, values
from ..outputs import note, report
from ..progress import Progress
from .stream import batches

EXAMPLE = "biotac record /dev/ttyACM0 grasp.mcap --seconds 30 --fact subject=S03 --fact trial=7"

FILES = ("bag:", "csv:", "replay:")  # ports that end by themselves


def add_arguments(parser: argparse.ArgumentParser) -> None:
    values.add_port(parser, "")
    parser.add_argument("out", metavar="OUT", type=Path, help="file to write, .mcap")
    parser.add_argument("--seconds", type=values.seconds, help="at least (default: until Ctrl-C or the source's end)")
    parser.add_argument("--note", default="", metavar="TEXT", help="a label of the whole recording")
    parser.add_argument("--fact", metavar="NAME=VALUE", action="append", default=[], help="subject=S07, for one")
    parser.add_argument("--force", action="store_true", help="overwrite OUT")


def run(args: argparse.Namespace) -> int:
    """Record until the time is over, the source ends or Ctrl-C."""
    progress, felt = Progress(), Felt()
    recorded_s = 0.0
    with biotac.open(args.port) as hand:
        earlier = latched_faults(hand)
        recorder = hand.record(args.out, overwrite=args.force, note=args.note, **values.facts(args.fact))
        hand.stream("results", "events")
        stopped = True
        with suppress(KeyboardInterrupt):  # the usual way to stop a recording
            for batch, recorded_s in batches(hand, args.seconds):
                applied_n = hand.applied_n(batch.wire["finger"], batch.t_us)
                if applied_n is not None:
                    felt.add(applied_n, batch.frames["force_n"])
                size_mb = recorder.path.stat().st_size / 1e6
                lost = hand.stats.frames_lost
                progress.show(
                    f"{recorded_s:.1f} s, {recorder.frames} frames, {lost} lost, {size_mb:.1f} MB, Ctrl-C stops"
                )
            stopped = False
        with ending.held():
            progress.done()
            recorder.close()
        stats = hand.stats
        faults = [line for line in latched_faults(hand) if line not in earlier]
        for warning in hand.warnings:
            note(warning.text)
    facts: dict[str, Any] = {
        "recording": str(args.out),
        "frames": recorder.frames,
        "frames_lost": recorder.frames_lost,
        "gaps": stats.gaps,
        "crc_errors": stats.crc_errors,
        "faults": faults,
        "device_seconds": recorded_s,
        "felt": felt.bands,
    }
    held = f"{args.out}: {recorder.frames} frames, {recorder.frames_lost} lost, {stats.gaps} gap(s)"
    lines = [f"{held}; `biotac check {args.out}` verifies them", *(f"fault during the recording: {f}" for f in faults)]
    lines += table({"felt": felt})
    report(args, facts, "\n".join(lines))
    if stopped and args.port.startswith(FILES):
        note(f"{args.port} was stopped at {recorded_s:.1f} s of it: the recording has not the rest")
    if args.seconds is not None and recorded_s < args.seconds:
        note(f"{recorded_s:.1f} s were recorded, {args.seconds:g} s asked for: it ended before")
        return 1
    return 0


def latched_faults(hand: biotac.Hand) -> list[str]:
    """The board's latched faults, a line each."""
    return str(hand.board.faults()).splitlines()
