"""biotac calibrate press PORT|REC"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import biotac

from ...calibrate import population
from ...calibrate.press import few_shot, known_force, pressure, pressure_procedure, weights
from ...calibrate.press.detector import MAX_N, Phase, PressStep
from ...calibrate.press.force_source import truth_of
from ...calibrate.reference.mounting import LIN
from ...calibrate.reference.scale import UNITS_N, SerialScale
from ...calibrate.wrench.sources import read_reference
from ...calibrate.wrench.upload import upload
from ...documents import DOUBT, write_new
from ...errors import CommandRefusedError, InputError
from ...hand.hand import Hand
from ...keep import calibration_file
from ...map import file as map_file
from ...map.bound import summary
from ...recording.reader import Recording
from ...wire.identity import ascii_text
from ...wire.sensor_gen import MAX_SENSORS
from .. import outputs, values
from ..recordings.loading import is_recording, load

NAME = "press"
HELP = (
    "A finger's own force from presses of known force: the population map fitted to presses on a kitchen scale, to "
    "weights or to a plate, or one gain from pressure to force. Guided on a board, or from a recording of that."
)
SIDES = ("its pad", "E1's side", "its tip", "E11's side")
EXAMPLE = "biotac calibrate press sim:scale.toml --scale --finger index"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("where", metavar="PORT|REC", help="a board, or a recording (.mcap) of such presses")
    against = parser.add_mutually_exclusive_group(required=True)
    against.add_argument(
        "--scale", metavar="PORT", nargs="?", const="",
        help="fit z and the balance of the population map to presses straight down on a scale, whose readings are "
        "typed in, or read from a serial port (MT-SICS or A&D, ?baud=9600&parity=N&bits=8)",
    )  # fmt: skip
    against.add_argument(
        "--weights", action="store_true", help="fit all axes of the population map to weights, level and tilted"
    )
    against.add_argument(
        "--plate", action="store_true",
        help="fit directions to a flat plate pressed on from all sides by hand; its size in newtons stays a guess",
    )  # fmt: skip
    against.add_argument(
        "--pressure", metavar="FILE", nargs="?", const="",
        help="from pressure to force, one gain per finger: press a plate or scale whose readings are typed in; for a "
        "recording, a reference as of calibrate wrench, by any clock, or a CSV with t_s and force_n",
    )  # fmt: skip
    parser.add_argument(
        "--finger", metavar="NAME,NAME", type=values.fingers, default=(),
        help="names or chip selects; one, or for --pressure several, in order (all)",
    )  # fmt: skip
    parser.add_argument(
        "--readings", metavar="X,X,X", type=values.numbers, help="the scale's reading at each press of a recording"
    )
    parser.add_argument("--unit", choices=list(UNITS_N), default="N", help="of the readings (default %(default)s)")
    parser.add_argument(
        "--presses", metavar="N", type=int, help="on a scale 5 by default (20 are better), of a plate 20"
    )
    for name, default, metavar, meaning in (
        ("--masses", weights.MASSES_G, "G,G", "weights in grams"),
        ("--tilts", weights.TILTS_DEG, "DEG,DEG", "degrees of the block under the weights"),
    ):
        text = f"{meaning} (default {','.join(f'{value:g}' for value in default)})"
        parser.add_argument(name, metavar=metavar, type=values.numbers, default=default, help=text)
    parser.add_argument("--population", metavar="FILE", type=Path, help="another map than the package's own")
    parser.add_argument(
        "--out", metavar="PATH", type=Path,
        help="the finger's map goes here (.wrench.json); with --pressure a folder, for a calibration of each finger",
    )  # fmt: skip
    parser.add_argument("--no-upload", action="store_true", help="leave the board as it is; not with --pressure")
    values.add_save(parser)
    parser.add_argument("--force", action="store_true", help="overwrite files; upload a map even if it does not help")


def run(args: argparse.Namespace) -> int:
    args.shown_n, code = {}, 1
    try:
        code = _run(args)
        return code
    finally:
        way = "--scale" if args.pressure is None else "--pressure"
        for finger, readings_n in args.shown_n.items() if code else ():
            readings = ",".join(f"{value_n:.4g}" for value_n in readings_n)
            outputs.note(
                f"what finger {finger} was pressed with is not lost: a recording of that goes on by `biotac calibrate "
                f"press REC {way} --finger {finger} --readings {readings}`, and those that are missing"
            )


def _run(args: argparse.Namespace) -> int:
    recorded = is_recording(args.where)
    if recorded and args.save:
        raise InputError("--save needs a board, not a recording: drop --save, or name a PORT")
    if args.pressure is not None:
        return _pressure(args, recorded=recorded)
    if len(args.finger) != 1:
        raise InputError(f"{len(args.finger)} fingers named: expected --finger NAME, the one that is pressed")
    outputs.check_file(args.out, overwrite=args.force)
    (finger,) = args.finger
    loads = weights.plan(args.masses, args.tilts) if args.weights else ()
    if recorded:
        recording = load(Path(args.where))
        serial = next((ascii_text(s.serial) for s in recording.sensors if s.finger == finger), "")
        return _fit_map(args, _recorded(args, recording, loads), serial, None)
    with biotac.open(args.where, pace=1.0) as hand:  # prompts that a person can follow
        values.check_answers(hand, finger)
        held = _guided(args, hand, loads)
        return _fit_map(args, held, ascii_text(hand.sensor_info(finger).serial), hand)


class _Guide:
    """A Prompt that prints instructions on stderr, leaving stdout to the result; ``press`` words a press."""

    def __init__(self, press: Callable[[PressStep], str], force_n: Callable[[PressStep], float], held: str) -> None:
        self._press, self.force_n, self._held = press, force_n, held

    def show(self, step: PressStep | None) -> None:
        if step is None:
            text = "done"
        elif step.phase is Phase.PRESS:
            text = f"{step.press} of {step.presses}: {self._press(step)}"
        elif step.phase is Phase.REST:
            text = f"let go of finger {step.finger}, and do not touch it"
        else:
            text = f"held: {self._held.format(finger=step.finger)}"
        print(text, file=sys.stderr)


def _noted_n(args: argparse.Namespace, step: PressStep, value_n: float) -> float:
    args.shown_n.setdefault(step.finger, []).append(value_n)
    return value_n


def _typed_n(step: PressStep, args: argparse.Namespace) -> float:
    """Ask on stderr until a force between 0 and MAX_N is typed in, in the unit of ``args``; in N."""
    unit = args.unit
    while True:
        print(
            f"finger {step.finger}, press {step.press}: the scale shows [{unit}] ", end="", file=sys.stderr, flush=True
        )
        try:
            value_n = float(input()) * UNITS_N[unit]
        except ValueError:
            continue
        except EOFError as error:
            raise InputError(f"no reading was typed in; expected a number in {unit}") from error
        if 0 < value_n < MAX_N:
            return _noted_n(args, step, value_n)
        print(f"expected above 0 and below {MAX_N:g} N; for grams start again with --unit g", file=sys.stderr)


def _readings_n(args: argparse.Namespace) -> list[float]:
    readings_n = [value * UNITS_N[args.unit] for value in args.readings or ()]
    if any(abs(value_n) >= MAX_N for value_n in readings_n):
        raise InputError(
            f"--readings up to {max(args.readings):g} {args.unit}: expected less than {MAX_N:g} N; name the scale's "
            "unit, such as --unit g"
        )
    return readings_n


def _check_terminal(hand: Hand, where: str) -> None:
    if hand.link.source is None and not sys.stdin.isatty():
        raise InputError(
            f"{where} gives no force, and stdin is not a terminal to type it in; use a terminal, or --scale PORT"
        )


# ---- a map, by a scale or by weights -----------------------------------------------------------


def _guided(args: argparse.Namespace, hand: Hand, loads: Sequence[weights.Load]) -> known_force.Held:
    """Presses on a board: by ``loads``, or without any on a scale."""
    (finger,) = args.finger
    if loads:
        face = _Guide(
            lambda step: f"{loads[step.press - 1]}; do not touch it",
            lambda step: loads[step.press - 1].size_n,
            "take the weight off",
        )
        sizes_n, toward = [load.size_n for load in loads], [load.toward for load in loads]
        return known_force.guided(hand, finger, sizes_n, face, toward=toward)

    def press(step: PressStep) -> str:
        return (
            f"push the pad straight down on the scale with about {step.force_n / UNITS_N[args.unit]:.0f} {args.unit}, "
            "in a new place each time; hold still until told"
        )

    asked_n = _asked_n(args)
    if args.plate:
        face = _Guide(
            lambda step: (
                f"push a flat plate straight onto {SIDES[(step.press - 1) % len(SIDES)]}; do not rub, hold still"
            ),
            lambda step: step.force_n,
            "take it off",
        )
        return known_force.guided(hand, finger, asked_n, face)
    if args.scale:
        with SerialScale(args.scale) as scale:
            face = _Guide(press, lambda step: _noted_n(args, step, scale.force_n()), "let go")
            return known_force.guided(hand, finger, asked_n, face)
    _check_terminal(hand, args.where)
    face = _Guide(press, lambda step: _typed_n(step, args), "let go")
    reference = truth_of(hand)
    return known_force.guided(hand, finger, asked_n, face, reference=reference)


def _asked_n(args: argparse.Namespace) -> list[float]:
    count = args.presses or (20 if args.plate else 5)
    return [known_force.ASKED_N[k % len(known_force.ASKED_N)] for k in range(count)]


def _recorded(args: argparse.Namespace, recording: Recording, loads: Sequence[weights.Load]) -> known_force.Held:
    if args.plate:
        return known_force.recorded(recording, args.finger[0], _asked_n(args), shown=False)
    if not loads and args.readings is None:
        raise InputError("a recording does not hold what the scale showed: expected --readings, one per press")
    forces_n = [load.size_n for load in loads] or _readings_n(args)
    return known_force.recorded(recording, args.finger[0], forces_n, [load.toward for load in loads] or None)


def _fit_map(args: argparse.Namespace, held: known_force.Held, serial: str, hand: Hand | None) -> int:
    """Fit the map; write and upload it only if it helps or --force is given. Return 1 if it does neither."""
    trained = population.load(args.population)
    way = few_shot.WEIGHTS if args.weights else few_shot.PLATE if args.plate else few_shot.SCALE
    if args.plate:
        held = known_force.of_plate(held, trained.population)
    found = known_force.found(trained.population, held, way)
    own = found.own.wrench_map(held.tare)
    (finger,), made_s = args.finger, int(time.time())
    why_not = found.why_not(trained.sigma_scale5_n)
    refused = bool(why_not) and not args.force
    facts: dict[str, Any] = {
        "finger": finger,
        "serial": serial,
        "presses": len(held.force_n),
        **({"shown_n": held.force_n[:, 2].tolist()} if args.scale is not None else {"force_n": held.force_n.tolist()}),
        **(asdict(found.scale) if found.scale else {}),
        "before_n": found.before_n.tolist(),
        "held_out_n": found.held_out_n.tolist(),
        "before_deg": found.before_deg,
        "held_out_deg": found.held_out_deg,
        "why_not": why_not,
        "refused": refused,
        "sigma_n": trained.sigma_scale5_n.tolist(),
        "state_n": found.to_state_n(trained.sigma_scale5_n).tolist(),
        "fixed_point": summary(own, held.counts),
    }
    if args.out is not None and not refused:
        software = trained.provenance.get("software", "")
        origin = {"serial": serial, "made_s": made_s, "software": software, "files": [args.where]}
        origin["reference"] = f"{len(held.force_n)} {way.name}; population map from {trained.fingers}"
        origin |= {DOUBT: why_not} if why_not else {}
        text = map_file.dumps_fitted(own, serial=serial, made_s=made_s, provenance=origin)
        write_new(args.out, text, overwrite=args.force)
        facts["written"] = str(args.out)
    if hand is not None and not args.no_upload and not refused:
        facts["board"] = upload(hand, finger, own, held.counts, serial=serial, made_s=made_s)
        if args.save:
            hand.board.save_settings()
    outputs.report(args, facts, "\n".join(_map_lines(facts, way.name)))
    return int(refused)


def _map_lines(facts: dict[str, Any], how: str) -> list[str]:
    def numbers(axes: Sequence[float]) -> str:
        return "  ".join(f"{value:5.2f}" for value in axes)

    gain = (
        "  z gain {gain:.3f} (one sigma {gain_sigma:.3f}), balance {balance:+.3f} N/N (one sigma {balance_sigma:.3f})"
    )
    state = "/".join(f"{error_n:.2f}" for error_n in facts["state_n"])
    return [
        f"finger {facts['finger']}, {facts['presses']} {how}",
        *([gain.format(**facts)] if "gain" in facts else []),
        f"  error along x, y, z before:   {numbers(facts['before_n'])} N, {facts['before_deg']:.1f} deg",
        f"  each press held out:          {numbers(facts['held_out_n'])} N, {facts['held_out_deg']:.1f} deg",
        f"  of other fingers, sheared too, after five presses on a scale: {numbers(facts['sigma_n'])} N, one sigma",
        *(["  neither written nor uploaded; --force does so all the same"] if facts["refused"] else []),
        *([f"  written: {facts['written']}"] if "written" in facts else []),
        "  on the board; without --save, only until it restarts" if "board" in facts else "  no board was changed",
        f"  not worth using: {facts['why_not']}" if facts["why_not"] else f"  usable: state an error of {state} N RMS",
    ]


# ---- from pressure to force --------------------------------------------------------------------


def _pressure(args: argparse.Namespace, *, recorded: bool) -> int:
    stem, made_s = f"{Path(args.where).stem}-" if recorded else "", int(time.time())
    not_saved = None
    if args.out is not None:
        every = [args.out / f"{stem}finger{finger}.json" for finger in args.finger or range(MAX_SENSORS)]
        outputs.check(args.out, every, overwrite=args.force)
    if recorded:
        reference = read_reference(args.pressure, LIN, size=True) if args.pressure else None
        readings_n = _readings_n(args)
        calibrated = pressure_procedure.calibrate_recording(
            load(Path(args.where)), reference, fingers=args.finger, forces_n=readings_n, made_s=made_s
        )
    elif args.pressure:
        raise InputError(
            "--pressure FILE needs a recording; on a board, type in what a scale shows: drop FILE, or record the "
            "presses together with the plate"
        )
    else:
        calibrated, not_saved = _on_board(args, made_s)
    written = []
    usable = [fitted for fitted in calibrated if args.force or not fitted.why_not]
    for fitted in usable if args.out is not None else ():
        outputs.make_folder(args.out)
        path = args.out / f"{stem}finger{fitted.fit.finger}.json"
        write_new(path, calibration_file.dumps(fitted.calibration, fitted.provenance), overwrite=args.force)
        written.append(str(path))
    lines = [*pressure.lines(calibrated), *(f"  written: {path}" for path in written)]
    if usable and not recorded and (not args.save or not_saved is not None):
        lines.append("in force until the next reboot (--save keeps it)")
    if len(usable) < len(calibrated):
        refused = ", ".join(str(fitted.fit.finger) for fitted in calibrated if fitted not in usable)
        lines.append(f"finger {refused}: neither put into force nor written; --force does so all the same")
    outputs.report(args, {"fingers": pressure.facts(calibrated), "written": written}, "\n".join(lines))
    if not_saved is not None:
        raise not_saved  # only now: the presses are not lost for this
    return int(len(usable) < len(calibrated))


def _on_board(args: argparse.Namespace, made_s: int) -> tuple[list[pressure.Calibrated], CommandRefusedError | None]:
    face = _Guide(
        lambda step: f"press finger {step.finger} with about {step.force_n:g} N, and hold still",
        lambda step: _typed_n(step, args),
        "let go of finger {finger}",
    )
    with biotac.open(args.where, pace=1.0) as hand:  # prompts that a person can follow
        _check_terminal(hand, args.where)
        calibrated = pressure_procedure.calibrate(hand, face, fingers=args.finger, made_s=made_s, force=args.force)
        try:
            if args.save and (args.force or not all(fitted.why_not for fitted in calibrated)):
                hand.board.save_settings()
        except CommandRefusedError as error:
            return calibrated, error
    return calibrated, None
