"""biotac calibrate pressure PORT|REC..."""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import biotac

from ...calibrate.pressure import from_recording, guided, report
from ...calibrate.pressure.force_source import load_csv
from ...calibrate.pressure.presses import CALIBRATION_FORCES_N, VERIFICATION_FORCES_N, Phase, Step
from ...errors import InputError
from ...hand.hand import Hand
from ...keep import calibration_file as file
from ...wire.sensor_gen import MAX_SENSORS
from .. import outputs, values
from ..recordings.loading import load
from .typed_readings import reading_n

NAME = "pressure"
HELP = "Pressure to force, one gain per finger: press a plate or scale, guided; or from recordings of that."
EXAMPLE = "biotac calibrate pressure sim:fingers.toml --out calibrated/"

WORDS = {Phase.REST: "let go of finger {f}", Phase.RELEASE: "held; let go of finger {f}"}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the board or recordings, the target force, and where the result goes."""
    parser.add_argument("where", metavar="PORT|REC", nargs="+", help="a board, or recordings (.mcap)")
    parser.add_argument(
        "--reference",
        metavar="FILE",
        type=Path,
        help="force over the board's time, for recordings: CSV with t_s and force_n (or fx_n, fy_n, fz_n)",
    )
    parser.add_argument(
        "--fingers", metavar="NAME,NAME", type=values.fingers, default=(), help="names or chip selects, in order (all)"
    )
    asked = ",".join(f"{force:g}" for force in CALIBRATION_FORCES_N)
    parser.add_argument(
        "--forces",
        metavar="N,N,N",
        type=_forces,
        help=f"newtons to press with ({asked}); of a recording without --reference, what the scale showed, the "
        "verification press last",
    )
    parser.add_argument(
        "--verify", metavar="N", type=_force, default=VERIFICATION_FORCES_N[0], help="newtons of the verification press"
    )
    parser.add_argument("--out", metavar="FOLDER", type=Path, help="one calibration file per finger goes here")
    parser.add_argument("--force", action="store_true", help="overwrite existing files")
    parser.add_argument("--save", action="store_true", help="save it on the board, so that it survives a restart")


def run(args: argparse.Namespace) -> int:
    """Calibrate on a board, or from every recording."""
    recordings = [place for place in args.where if Path(place).is_file() or place.endswith(".mcap")]
    if recordings and len(recordings) < len(args.where):
        raise InputError(f"{' '.join(args.where)}: expected one board or only recordings, not both")
    if not recordings and len(args.where) > 1:
        raise InputError(f"{len(args.where)} boards given; expected one")
    if recordings and args.save:
        raise InputError("--save needs a board; `biotac calibration put --save` uploads a file to one")
    if args.out is not None:
        _check_out(args, recordings)
    if not recordings:
        if args.reference is not None:
            raise InputError(
                "--reference needs a recording; on a board, type in what a scale shows: drop --reference, or record "
                "the presses together with the plate"
            )
        outcome = _on_board(args)
        _tell(args, outcome, None)
        if outcome.not_saved is not None:
            raise outcome.not_saved
        return 0
    reference = load_csv(args.reference) if args.reference is not None else None
    for place in recordings:
        outcome = from_recording.calibrate(
            load(Path(place)),
            reference,
            fingers=args.fingers,
            forces_n=args.forces or (),
            made_s=int(time.time()),
        )
        _tell(args, outcome, place)
    return 0


def _on_board(args: argparse.Namespace) -> report.Outcome:
    (port,) = args.where
    plan = guided.Plan(args.fingers, args.forces or CALIBRATION_FORCES_N, (args.verify,))

    def opened() -> Hand:
        hand = biotac.open(port)
        if hand.link.source is None and not sys.stdin.isatty():
            hand.close()
            raise InputError(f"{port} gives no force, and stdin is not a terminal to type it in; run it in a terminal")
        return hand

    return guided.calibrate(opened, plan, _Terminal(), made_s=int(time.time()), save=args.save)


class _Terminal:
    """A guided.Face on stderr, leaving stdout to the result."""

    def show(self, step: Step | None) -> None:
        if step is None:
            print("done", file=sys.stderr)
        elif step.phase is Phase.PRESS:
            which = f"press {step.press} of {step.presses}: finger {step.finger}"
            print(f"{which} with about {step.force_n:g} N, and hold still", file=sys.stderr)
        else:
            print(WORDS[step.phase].format(f=step.finger), file=sys.stderr)

    def force_n(self, step: Step) -> float:
        return reading_n(f"finger {step.finger}, press {step.press}")


def _tell(args: argparse.Namespace, outcome: report.Outcome, name: str | None) -> None:
    written = _write(args, outcome, name) if args.out is not None else []
    if args.json:
        print(json.dumps({"fingers": report.facts(outcome), "written": written}))
        return
    print("\n".join([*([f"{name}:"] if name else []), *report.lines(outcome), *(f"  written: {w}" for w in written)]))
    if name is None and (not args.save or outcome.not_saved is not None):
        print("in force until the next reboot (--save keeps it)")


def _place(args: argparse.Namespace, name: str | None, finger: int) -> Path:
    stem = f"{Path(name).stem}-" if name else ""
    return Path(args.out) / f"{stem}finger{finger}.json"


def _check_out(args: argparse.Namespace, recordings: list[str]) -> None:
    names: list[str | None] = [*recordings] or [None]
    places = [_place(args, name, finger) for name in names for finger in args.fingers or range(MAX_SENSORS)]
    outputs.check(args.out, places, overwrite=args.force)


def _write(args: argparse.Namespace, outcome: report.Outcome, name: str | None) -> list[str]:
    outputs.make_folder(args.out)
    written = []
    for finger, its in outcome.calibrations.items():
        place = _place(args, name, finger)
        file.save(place, its, outcome.provenance[finger], overwrite=args.force)
        written.append(str(place))
    return written


def _force(text: str) -> float:
    force = values.number(text)
    if not 0 < force < 100:
        raise argparse.ArgumentTypeError(f"seen {text!r}; expected newtons above 0 and below 100")
    return force


def _forces(text: str) -> tuple[float, ...]:
    return tuple(_force(part) for part in text.split(","))
