"""What `calibrate scale` and `calibrate weights` share: a few presses fit the population map to one finger."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import biotac

from ...calibrate.population import population_map
from ...calibrate.population.presses import Fit, Held, found
from ...calibrate.pressure.presses import Phase, Step
from ...calibrate.wrench.sources import Provenance
from ...calibrate.wrench.upload import upload
from ...errors import InputError
from ...hand.hand import Hand
from ...map import file
from ...map.bound import summary
from ...partial_file import whole
from ...recording import Recording
from ...wire.identity import ascii_text
from .. import outputs, values
from ..recordings.loading import load

CURE = "tare, and load the pad flat, firmly and steadily, or upload it anyway with --force"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the finger, and where the map goes."""
    parser.add_argument("where", metavar="PORT|REC", help="a board, or a recording (.mcap) of such presses")
    parser.add_argument("--finger", metavar="NAME", type=values.finger, required=True, help="name or chip select")
    parser.add_argument("--population", metavar="FILE", type=Path, help="another map than the package's own")
    parser.add_argument("--out", metavar="FILE", type=Path, help="the finger's map goes here (.wrench.json)")
    parser.add_argument("--no-upload", action="store_true", help="leave the board as it is")
    parser.add_argument("--save", action="store_true", help="save the map on the board, so that it survives a restart")
    parser.add_argument(
        "--force", action="store_true", help="overwrite existing files; upload even if it does not help"
    )


@dataclass(frozen=True)
class Pressed:
    """The presses ``held`` of sensor ``serial``; ``hand`` is the board, or None for a recording."""

    held: Held
    serial: str
    hand: Hand | None


@contextmanager
def pressed(
    args: argparse.Namespace, guide: Callable[[Hand], Held], recorded: Callable[[Recording], Held]
) -> Iterator[Pressed]:
    """The presses, from a board by ``guide`` or from a recording by ``recorded``. Raises InputError."""
    outputs.check_file(args.out, overwrite=args.force)
    if Path(args.where).is_file() or args.where.endswith(".mcap"):
        if args.save:
            raise InputError("--save needs a board, not a recording: drop --save, or name a PORT")
        recording = load(Path(args.where))
        serial = next((ascii_text(its.serial) for its in recording.sensors if its.finger == args.finger), "")
        yield Pressed(recorded(recording), serial, None)
        return
    with biotac.open(args.where) as hand:
        if args.finger not in hand.fingers:
            raise InputError(f"finger {args.finger} does not answer: expected one of {hand.fingers}; check its cable")
        held = guide(hand)
        yield Pressed(held, ascii_text(hand.sensor_info(args.finger).serial), hand)


class Guide:
    """A guided.Face that prints instructions on stderr, leaving stdout to the result; ``press`` words a press."""

    def __init__(self, press: Callable[[Step], str], force_n: Callable[[Step], float], held: str) -> None:
        self._press, self._force_n, self._held = press, force_n, held

    def show(self, step: Step | None) -> None:
        if step is not None:
            words = {Phase.REST: "let go, and do not touch it", Phase.RELEASE: self._held}
            said = self._press(step) if step.phase is Phase.PRESS else words[step.phase]
            print(said, file=sys.stderr)

    def force_n(self, step: Step) -> float:
        return self._force_n(step)


def tell(
    args: argparse.Namespace, its: Pressed, fit: Fit, how: str, more: Callable[[population_map.Trained], dict[str, Any]]
) -> dict[str, Any]:
    """Fit the map, and upload it only if it helps or --force is given; return the findings as JSON types.

    ``how`` says where the force is from; ``more`` gives further findings.
    """
    trained = population_map.load(args.population)
    result = found(trained.population, its.held, fit)
    own = result.own.wrench_map(its.held.tare)
    made_s = int(time.time())
    facts: dict[str, Any] = {
        "finger": args.finger,
        "serial": its.serial,
        "presses": len(its.held.force_n),
        **more(trained),
        "before_n": result.before_n.tolist(),
        "held_out_n": result.held_out_n.tolist(),
        "why_not": result.why_not(trained.sigma_scale5_n),
        "sigma_n": trained.sigma_scale5_n.tolist(),
        "fixed_point": summary(own, its.held.counts),
    }
    if args.out is not None:
        origin = Provenance(
            its.serial, made_s, trained.provenance.get("software", ""), (args.where,), "",
            f"{len(its.held.force_n)} {how}; population map from {', '.join(trained.provenance.get('files', {}))}",
        )  # fmt: skip
        with whole(args.out, overwrite=args.force) as place:
            text = file.dumps_fitted(own, serial=its.serial, made_s=made_s, provenance=asdict(origin))
            place.write_text(text, encoding="utf-8")
        facts["written"] = str(args.out)
    wanted = its.hand is not None and not args.no_upload
    facts["refused"] = wanted and bool(facts["why_not"]) and not args.force
    if its.hand is not None and wanted and not facts["refused"]:
        facts["board"] = upload(its.hand, args.finger, own, its.held.counts, serial=its.serial, made_s=made_s)
        if args.save:
            its.hand.save_settings()
    return facts


def show(args: argparse.Namespace, facts: dict[str, Any], title: str) -> int:
    """Print the findings on stdout, as JSON or as lines. Return 1 if a map was to go to a board and did not."""

    def numbers(of: Sequence[float]) -> str:
        return "  ".join(f"{value:5.2f}" for value in of)

    lines = [
        f"finger {facts['finger']}, {title}",
        f"  error along x, y, z before:   {numbers(facts['before_n'])} N",
        f"  each press held out:          {numbers(facts['held_out_n'])} N",
        f"  one sigma after five presses: {numbers(facts['sigma_n'])} N, with shear",
        *([f"  not worth using: {facts['why_not']}; {CURE}"] if facts["why_not"] else []),
        *([f"  written: {facts['written']}"] if "written" in facts else []),
        "  on the board; without --save, only until it restarts" if "board" in facts else "  no board was changed",
    ]
    print(json.dumps(facts) if args.json else "\n".join(lines))
    return int(facts["refused"])
