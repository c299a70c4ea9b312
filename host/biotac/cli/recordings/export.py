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
    """Add the recordings, the output, and whether to overwrite."""
    parser.add_argument("recordings", metavar="REC", nargs="+", type=Path, help="file written by biotac record")
    formats = "; ".join(f"{suffix} {its.what}" for suffix, its in FORMATS.items())
    # Without --lake the last word is OUT. It is here for argparse's help; run() takes it from the recordings.
    parser.add_argument("out", metavar="OUT", nargs="?", type=Path, help=f"file to write: {formats}")
    parser.add_argument("--force", action="store_true", help="overwrite OUT, or the recordings' files in the lake")
    lake.add_export_arguments(parser)


def run(args: argparse.Namespace) -> int:
    """Write OUT, or leave nothing behind; stderr says what the recording lacks."""
    places = [*args.recordings, *([args.out] if args.out else [])]
    if args.lake is not None:
        return lake.run_export(args, places)
    if len(places) != 2:
        raise InputError(f"{len(places)} files given, expected REC OUT; to export many recordings, use --lake DIR")
    source, out = places
    recording = load(source)
    with Progress() as progress:
        written = export(
            recording,
            out,
            overwrite=args.force,
            show=lambda share: progress.show(f"{out}: {share:.0%}, Ctrl-C stops and leaves nothing behind"),
        )
    names = [str(path) for path in written]
    facts = {"written": names, "frames": len(recording.frames), "pac": len(recording.pac)}
    print(json.dumps(facts) if args.json else f"{len(recording.frames)} frames to {', '.join(names)}")
    return 0
