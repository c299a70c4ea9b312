"""biotac export REC OUT, and biotac export REC... --lake DIR"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from ...errors import InputError
from ...export import FORMATS, export
from ..progress import Progress
from . import lake
from .loading import load

EXAMPLE = "biotac export grasp.mcap grasp.parquet, or biotac export trials/*.mcap --lake trials.lake -j 4"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Recordings, where to, and whether to overwrite."""
    parser.add_argument("recordings", metavar="REC", nargs="+", type=Path, help="file written by biotac record")
    formats = "; ".join(f"{suffix} {its.what}" for suffix, its in FORMATS.items())
    # The last of the words is OUT where there is no lake; argparse shows it, and run() takes it from the others.
    parser.add_argument("out", metavar="OUT", nargs="?", type=Path, help=f"file to write: {formats}")
    parser.add_argument("--force", action="store_true", help="overwrite OUT, or what the lake has of the recordings")
    lake.add_export_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Write OUT, or leave nothing behind; what the recording lacks is said on stderr."""
    places = [*args.recordings, *([args.out] if args.out else [])]
    if args.lake is not None:
        return lake.run_export(args, places)
    if len(places) != 2:
        raise InputError(f"{len(places)} files are named, expected REC OUT; many recordings go to --lake DIR")
    source, out = places
    recording = load(source)
    progress = Progress()
    try:
        written = export(
            recording,
            out,
            overwrite=args.force,
            show=lambda share: progress.show(f"{out}: {share:.0%}, Ctrl-C stops and leaves nothing behind"),
        )
    finally:
        progress.done()
    names = [str(path) for path in written]
    facts = {"written": names, "frames": len(recording.frames), "pac": len(recording.pac)}
    print(json.dumps(facts) if args.json else f"{len(recording.frames)} frames to {', '.join(names)}")
    return 0
