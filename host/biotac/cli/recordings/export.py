"""biotac export REC OUT, and biotac export REC... DIR --partition"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...documents import read_json
from ...errors import InputError, printable
from ...export import FORMATS, export
from ...export.formats import writer_for
from ...hand.opening import shake_hands
from ...link import open_link
from ...link.port_text import how_to_record
from ...partial_file import whole
from ...recording.btd.file import read_btd
from ...recording.layout import finger_of
from ...recording.reader import Recording
from ...recording.recompute import recompute
from ...wire import messages_gen as wire
from ...wire.identity import setting_text
from .. import gone, outputs, values
from ..progress import Progress
from . import many
from .loading import code, load

EXAMPLE = "biotac export grasp.mcap grasp.parquet, or biotac export trials/*.mcap trials --partition -j 4"
RECORDING = ".mcap"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "recordings", metavar="REC", nargs="+", type=Path, help="file written by biotac record, or SynTouch's .btd(.gz)"
    )
    formats = "; ".join(f"{suffix} {kind.meaning}" for suffix, kind in FORMATS.items())
    # The last word is OUT. It is here for argparse's help; run() removes it from the recordings.
    parser.add_argument(
        "out",
        metavar="OUT",
        nargs="?",
        type=Path,
        help=f"file to write: {formats}; of a .btd, or recomputed, an .mcap is a recording",
    )
    parser.add_argument("--force", action="store_true", help="overwrite OUT, or a recording's files in DIR")
    parser.add_argument("--recompute", action="store_true", help="run the counts through the maths again")
    names = [weights.name.lower() for weights in wire.PocWeights]
    parser.add_argument("--poc-weights", choices=names, help="recompute with these weights of the point of contact")
    parser.add_argument(
        "--settings", metavar="FILE", type=Path, help="recompute with these: JSON by name, as biotac info --json prints"
    )
    parser.add_argument(
        "--keep-tare", action="store_true", help="recompute with the recorded tares, not with the tare machine's"
    )
    parser.add_argument(
        "--trace", action="store_true", help="beside a .csv or .parquet: the tare's evidence and decisions by sweep"
    )
    parser.add_argument(
        "--frame",
        metavar="FINGER=ID",
        action="append",
        default=[],
        help="a finger's frame, for rviz: index=rh_ffdistal names it and turns nothing; index=rh_ffdistal@90,0,0 turns "
        "vectors by the roll, pitch and yaw, in degrees, of the BioTac's axes in it",
    )
    parser.add_argument("--beside", metavar="BAG", type=Path, help="copy this bag's messages into the .bag or .ros2")
    text = "write every REC into the folder OUT, as Parquet by day and finger"
    parser.add_argument("--partition", action="store_true", help=text)
    parser.add_argument("-j", dest="jobs", metavar="N", type=values.count(1024), default=1, help="with N processes")
    parser.add_argument("--lake", help=argparse.SUPPRESS)  # gone; run() names the replacement


def run(args: argparse.Namespace) -> int:
    """Write OUT, or nothing at all; stderr lists damage and gaps. Return 1 if the recording is damaged."""
    paths = [*args.recordings, *([args.out] if args.out else [])]
    recomputes = bool(args.recompute or args.poc_weights or args.settings or args.keep_tare)
    if args.lake is not None:
        raise InputError(gone.LAKE)
    if args.partition:
        if recomputes or args.trace or args.frame or args.beside:
            raise InputError("--partition takes recordings as they are; export each of them by itself with that option")
        return many.run(args, paths)
    if len(paths) != 2:
        raise InputError(
            f"{len(paths)} files given, expected REC OUT; to export many recordings, add --partition and name a folder"
        )
    source, out = paths
    imports = source.name.lower().endswith((".btd", ".btd.gz"))
    is_recording = out.suffix.lower() == RECORDING
    if not (is_recording and (imports or recomputes)):
        writer_for(out)
    if is_recording and not recomputes and (cure := how_to_record(source)):
        raise InputError(f"{source} is no recording; {cure}")
    if is_recording and imports and recomputes:
        raise InputError(f"{source} is recomputed as it is read; export it to .mcap first, then recompute that")
    if args.trace and (imports or recomputes):
        raise InputError("a trace is of a recording as it is; import or recompute it to .mcap first")
    written: list[Path] = []
    with Progress() as progress:

        def show(share: float) -> None:
            progress.show(f"{out}: {share:.0%}, Ctrl-C stops and leaves nothing behind")

        if imports:
            with _recording_at(out, source, args.force, written) as target:
                made: dict[str, Any] = import_btd(source, target)
            for note in made["notes"]:
                outputs.note(printable(note))
            text = f"{made['frames']} frames of {made['fingers']} finger(s), {made['skipped']} incomplete skipped"
        elif recomputes:
            changes = read_settings(args.settings) if args.settings else {}
            if args.poc_weights:
                changes[wire.Setting.POC_WEIGHTS] = int(wire.PocWeights[args.poc_weights.upper()])
            recording = load(source)
            with _recording_at(out, source, args.force, written) as target:
                notes = recompute(recording, target, changes, keep_tare=args.keep_tare, show=show)
            for note in notes:
                outputs.note(printable(note))
            made = {"frames": len(recording.frames), "pac": len(recording.pac), "notes": notes}
            changed = ", ".join(setting_text(s, value) for s, value in changes.items()) or "no setting changed"
            text = f"{made['frames']} frames, {changed},"
        else:
            recording = load(source)
            frames = frames_of(args.frame, recording.names)
            turns = {finger: turn_of(text) for finger, text in frames.items() if "@" in text}
            frames = {finger: text.partition("@")[0] for finger, text in frames.items()}
            how = {"frames": frames, "turns": turns, "beside": args.beside, "trace": args.trace}
            written += export(recording, out, overwrite=args.force, show=show, **how)
            made = {"frames": len(recording.frames), "pac": len(recording.pac)}
            text = f"{made['frames']} frames"
    names = [str(path) for path in written]
    outputs.report(args, {"written": names} | made, printable(f"{text} to {', '.join(names)}"))
    return 0 if imports else code(recording)


@contextmanager
def _recording_at(out: Path, source: Path, force: bool, written: list[Path]) -> Iterator[Path]:
    """Where to write a recording that becomes ``out``, or is exported there; ``written`` gets the files' paths."""
    if out.suffix.lower() == RECORDING:
        with whole(out, overwrite=force, sources=[source]) as target:
            yield target
        written.append(out)
        return
    try:
        with TemporaryDirectory(prefix="biotac-export-") as folder:
            target = Path(folder) / "made.mcap"
            yield target
            written += export(Recording(target), out, overwrite=force)
    except KeyboardInterrupt as interrupt:
        raise KeyboardInterrupt(*interrupt.args or (f"{out} was not written",)) from None


def import_btd(path: Path, out: Path) -> dict[str, Any]:
    """Record a .btd's counts, run through the board's own code; the numbers of fingers, frames and incomplete ones."""
    skipped = read_btd(path).skipped
    with shake_hands(open_link(f"btd:{path}")) as hand, hand.record(out) as recorder:
        hand.stream("results", "events")
        for _ in hand.batches():
            pass
        recorder.close()
        counts = {"fingers": len(hand.fingers), "frames": recorder.frames, "skipped": skipped}
        return counts | {"notes": list(hand.link.notes)}


def frames_of(given: list[str], names: Mapping[str, int]) -> dict[int, str]:
    """Coordinate frames by finger from FINGER=ID. Raises InputError for a finger that is unknown."""
    try:
        parts = [text.partition("=") for text in given]
        return {finger_of(int(finger) if finger.isdecimal() else finger, names): name for finger, _, name in parts}
    except KeyError as error:
        raise InputError(f"--frame: {error.args[0]}") from error


def turn_of(text: str) -> NDArray[np.float64]:
    """The rotation (3, 3) in ID@ROLL,PITCH,YAW, about the fixed axes x, y, z in turn, as in a URDF."""
    try:
        roll, pitch, yaw = (math.radians(float(part)) for part in text.partition("@")[2].split(","))
        if not all(map(math.isfinite, (roll, pitch, yaw))):
            raise ValueError
    except ValueError:
        raise InputError(f"--frame: {text!r}, expected ID or ID@ROLL,PITCH,YAW in degrees") from None
    (sx, sy, sz), (cx, cy, cz) = ([f(a) for a in (roll, pitch, yaw)] for f in (math.sin, math.cos))
    about_x, about_y = [[1, 0, 0], [0, cx, -sx], [0, sx, cx]], [[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]]
    turn: NDArray[np.float64] = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]]) @ about_y @ about_x
    return turn


def read_settings(path: Path) -> dict[wire.Setting, int]:
    """Settings by name from a JSON file. Raises InputError that names the fault."""
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
