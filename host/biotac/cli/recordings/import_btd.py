"""biotac import FILE.btd OUT.mcap"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from ...partial_file import whole
from ...recording.btd_import import import_btd
from ..progress import Progress

EXAMPLE = "biotac import trial.btd trial.mcap"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add input and output."""
    parser.add_argument("file", metavar="FILE", type=Path, help=".btd or .btd.gz")
    parser.add_argument("out", metavar="OUT", type=Path, help="recording to write, .mcap")
    parser.add_argument("--force", action="store_true", help="overwrite OUT")


def run(args: argparse.Namespace) -> int:
    """Write OUT, or leave nothing behind."""
    with Progress() as progress, whole(args.out, overwrite=args.force) as place:
        done = import_btd(args.file, place, lambda share: progress.show(f"{args.out}: {share:.0%}"))
    if args.json:
        print(json.dumps({"recording": str(args.out)} | done))
        return 0
    print(
        f"{args.out}: {done['frames']} frames of {done['fingers']} finger(s); "
        f"{done['skipped']} incomplete frame(s) of {args.file} skipped"
    )
    return 0
