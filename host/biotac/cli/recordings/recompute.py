"""biotac recompute REC OUT"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from ...documents import read_json
from ...errors import InputError
from ...export import export
from ...partial_file import whole
from ...recording import Recording
from ...recording.recompute import recompute
from ...wire import messages_gen as wire
from ...wire.identity import setting_text
from ..progress import Progress
from .loading import load

EXAMPLE = "biotac recompute grasp.mcap again.mcap --poc-weights compress_n2"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recording, the output, and what to change."""
    parser.add_argument("recording", metavar="REC", type=Path, help="file written by biotac record; it is not changed")
    parser.add_argument("out", metavar="OUT", type=Path, help=".mcap, or any format of biotac export")
    names = [weights.name.lower() for weights in wire.PocWeights]
    parser.add_argument("--poc-weights", choices=names, help="weights of the electrodes in the point of contact")
    parser.add_argument(
        "--settings", metavar="FILE", type=Path, help="JSON object of settings by name, as biotac info --json prints"
    )
    parser.add_argument(
        "--keep-tare", action="store_true", help="keep recorded tares and contacts instead of running the tare machine"
    )
    parser.add_argument("--force", action="store_true", help="overwrite OUT")


def run(args: argparse.Namespace) -> int:
    """Write OUT, or leave nothing behind."""
    progress = Progress()
    changes = read_settings(args.settings) if args.settings else {}
    if args.poc_weights:
        changes[wire.Setting.POC_WEIGHTS] = int(wire.PocWeights[args.poc_weights.upper()])
    recording = load(args.recording)
    options: dict[str, Any] = {"keep_tare": args.keep_tare}
    options["show"] = lambda share: progress.show(f"{args.out}: {share:.0%}, Ctrl-C stops and leaves nothing behind")
    try:
        if args.out.suffix.lower() == ".mcap":
            with whole(args.out, overwrite=args.force) as place:
                notes = recompute(recording, place, changes, **options)
        else:
            with tempfile.TemporaryDirectory(prefix="biotac-recompute-") as folder:
                place = Path(folder) / "recomputed.mcap"
                notes = recompute(recording, place, changes, **options)
                export(Recording(place), args.out, overwrite=args.force)
    except KeyboardInterrupt as interrupt:
        raise KeyboardInterrupt(*interrupt.args or (f"{args.out} was not written",)) from None
    finally:
        progress.done()
    for note in notes:
        print(f"biotac: {note}", file=sys.stderr)
    facts = {"recording": str(args.out), "frames": len(recording.frames), "notes": notes}
    changed = ", ".join(setting_text(setting, value) for setting, value in changes.items()) or "no setting changed"
    print(json.dumps(facts) if args.json else f"{args.out}: {len(recording.frames)} frames, {changed}")
    return 0


def read_settings(path: Path) -> dict[wire.Setting, int]:
    """Settings by name from a JSON file. Raises InputError naming what is wrong in it."""
    try:
        named = read_json(path)
    except (OSError, ValueError) as error:
        raise InputError(f"{path} cannot be read as JSON ({error}); expected an object of settings") from error
    # `biotac info --json` prints them under "settings".
    named = named.get("settings", named) if isinstance(named, dict) else named
    known = {setting.name.lower(): setting for setting in wire.Setting}
    if not isinstance(named, dict) or not all(type(value) is int for value in named.values()):
        raise InputError(f'{path} is not a JSON object of integers; expected one such as {{"poc_weights": 2}}')
    unknown = sorted(set(named) - set(known))
    if unknown:
        raise InputError(f"{path}: unknown setting {unknown[0]!r}; expected one of {', '.join(known)}")
    return {known[name]: value for name, value in named.items()}
