"""biotac export REC OUT"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from ...export import FORMATS, export
from ..progress import Progress
from .loading import load

EXAMPLE = "biotac export grasp.mcap grasp.parquet"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Recording, file and whether to overwrite."""
    parser.add_argument("recording", metavar="REC", type=Path, help="file written by biotac record")
    formats = "; ".join(f"{suffix} {its.what}" for suffix, its in FORMATS.items())
    parser.add_argument("out", metavar="OUT", type=Path, help=f"file to write: {formats}")
    parser.add_argument("--force", action="store_true", help="overwrite OUT")


def run(args: argparse.Namespace) -> int:
    """Write OUT, or leave nothing behind; what the recording lacks is said on stderr."""
    recording = load(args.recording)
    progress = Progress()
    try:
        written = export(
            recording,
            args.out,
            overwrite=args.force,
            show=lambda share: progress.show(f"{args.out}: {share:.0%}, Ctrl-C stops and leaves nothing behind"),
        )
    finally:
        progress.done()
    names = [str(path) for path in written]
    facts = {"written": names, "frames": len(recording.frames), "pac": len(recording.pac)}
    print(json.dumps(facts) if args.json else f"{len(recording.frames)} frames to {', '.join(names)}")
    return 0
