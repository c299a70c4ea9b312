"""The whole procedure with a board: presses, K, onto the board, read back, and the verification press it tells itself.

A board takes no calibration while it streams. Between the presses and the verification the stream is stopped; but
emulated time that no pace holds back would run on meanwhile, so such a board is started again, and of its second life
only what comes after the first presses is looked at.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from ...errors import CommandRefusedError, InputError
from ...hand.hand import Hand
from ...keep import Calibration
from ...wire import messages_gen as wire
from ...wire.identity import ascii_text, serial_text
from . import report
from .fit import MIN_PRESSES, Fit, fit, verify
from .force_source import Reference, Truth, Unknown
from .presses import CALIBRATION_FORCES_N, VERIFICATION_FORCES_N, Phase, Press, Procedure, Step
from .report import Outcome
from .rows import rows_of


class Face(Protocol):
    """Whoever stands between this and a person."""

    def show(self, step: Step | None) -> None:
        """The next thing to do."""

    def force_n(self, step: Step) -> float:
        """What the scale shows at the press that was just held; asked where there is no reference."""


@dataclass(frozen=True)
class Plan:
    """Fingers (none: all that are there) and the newtons that are asked for."""

    fingers: tuple[int, ...] = ()
    forces_n: tuple[float, ...] = CALIBRATION_FORCES_N
    verification_n: tuple[float, ...] = VERIFICATION_FORCES_N


def calibrate(open_hand: Callable[[], Hand], plan: Plan, face: Face, *, made_s: int, save: bool = False) -> Outcome:
    """Run ``plan`` on the board that ``open_hand`` opens; the reference is its scenario's force, or ``face``'s word.

    ``save`` keeps the result over reboots once every finger is verified (Outcome.not_saved). Raises InputError for
    presses that cannot be used, for a finger without a sensor, and for a sensor that was changed under way; nothing is
    on the board then, or until the next reboot at most.
    """
    if len(plan.forces_n) < MIN_PRESSES:
        raise InputError(f"{len(plan.forces_n)} presses are planned, expected {MIN_PRESSES} or more; name more forces")
    with open_hand() as hand:
        fingers = _fingers(hand, plan)
        serials = {finger: _serial(hand, finger) for finger in fingers}
        reference: Reference = Unknown() if hand.link.source is None else Truth(hand.link.source)
        first = _run(hand, Procedure(fingers, plan.forces_n, needs_force=_known(reference)), reference, face)
        fits = {finger: fit(first.procedure.rests[finger], mine) for finger, mine in first.presses.items()}
        again = hand.link.source is not None and hand.link.pace == 0
        if not again:
            hand.stop()
            return _on_board(hand, fits, serials, reference, face, plan, made_s, save=save, after_us=0)
    with open_hand() as hand:
        assert hand.link.source is not None
        second = Truth(hand.link.source)
        return _on_board(hand, fits, serials, second, face, plan, made_s, save=save, after_us=first.lasted_us)


@dataclass(frozen=True)
class _Held:
    procedure: Procedure
    presses: dict[int, list[Press]]
    lasted_us: int


def _run(hand: Hand, procedure: Procedure, reference: Reference, face: Face, *, after_us: int = 0) -> _Held:
    typed: dict[tuple[int, int], float] = {}

    def show(step: Step | None) -> None:
        if not _known(reference):
            ask_forces(procedure, typed, face)
        face.show(step)

    drive(hand, procedure, reference, show, after_us=after_us)
    presses = {
        finger: [press.with_force(typed[finger, press.number]) if typed else press for press in held]
        for finger, held in procedure.presses.items()
    }
    last_us = max(int(press.rows["t_us"][-1]) for held in presses.values() for press in held)
    first_us = reference.first_us if isinstance(reference, Truth) else 0
    return _Held(procedure, presses, last_us - first_us)


def ask_forces(procedure: Procedure, typed: dict[tuple[int, int], float], face: Face) -> None:
    """The force of every press that has none yet: more than one, when somebody presses faster than they type."""
    for finger, presses in procedure.presses.items():
        for press in presses:
            if (finger, press.number) not in typed:
                asked = procedure.forces_n[press.number - 1]
                step = Step(finger, Phase.RELEASE, press.number, len(procedure.forces_n), asked)
                typed[finger, press.number] = face.force_n(step)


def _on_board(
    hand: Hand,
    fits: dict[int, Fit],
    serials: dict[int, str],
    reference: Reference,
    face: Face,
    plan: Plan,
    made_s: int,
    *,
    save: bool,
    after_us: int,
) -> Outcome:
    calibrations, provenance = {}, {}
    for finger, its in fits.items():
        now = _serial(hand, finger)
        if now != serials[finger]:
            raise InputError(
                f"finger {finger} is sensor {now!r} and was {serials[finger]!r} when it was pressed; expected one and "
                "the same: begin again"
            )
        calibrations[finger] = with_gain(hand, its, made_s)
        provenance[finger] = report.provenance(its, **{"from": hand.port, "board_serial": serial_text(hand.info)})
        put(hand, finger, calibrations[finger])
    verified = {}
    if plan.verification_n:
        procedure = Procedure(list(fits), plan.verification_n, needs_force=_known(reference))
        held = _run(hand, procedure, reference, face, after_us=after_us)
        verified = {finger: verify(fits[finger], presses[-1]) for finger, presses in held.presses.items()}
        hand.stop()
    not_saved = None
    if save:
        try:
            hand.save_settings()
        except CommandRefusedError as error:
            not_saved = error  # no reason to lose all that was pressed
    return Outcome(fits, calibrations, provenance, verified, not_saved=not_saved)


def _known(reference: Reference) -> bool:
    return not isinstance(reference, Unknown)


def _fingers(hand: Hand, plan: Plan) -> Sequence[int]:
    absent = sorted(set(plan.fingers) - set(hand.fingers))
    if absent or not hand.fingers:
        there = ", ".join(map(str, hand.fingers)) or "none"
        which = absent[0] if absent else "any"
        raise InputError(f"no sensor answers as finger {which}: there {'is' if not hand.fingers else 'are'} {there}")
    return plan.fingers or tuple(hand.fingers)


def _serial(hand: Hand, finger: int) -> str:
    return ascii_text(hand.sensor_info(finger).serial)


Show = Callable[[Step | None], None]


def drive(
    hand: Hand,
    procedure: Procedure,
    reference: Reference,
    show: Show = lambda step: None,
    *,
    after_us: int = 0,
) -> None:
    """Feed ``procedure`` with what ``hand`` streams until it is done, telling ``show`` each new step.

    Starts the stream if need be and leaves it on; the first ``after_us`` of device time are passed over. Raises
    InputError when a finger waits in vain, or a simulated source ends first.
    """
    shown: Step | None = procedure.step
    show(shown)
    first_us: int | None = None
    for batch in hand.batches():
        force_n = reference.at(batch.wire["finger"], batch.t_us)
        rows = rows_of(batch.wire, batch.t_us, force_n)
        if first_us is None and len(rows):
            first_us = int(rows["t_us"].min())
        procedure.feed(rows[rows["t_us"] - (first_us or 0) >= after_us])
        if procedure.step != shown:
            shown = procedure.step
            show(shown)
        if procedure.done:
            return
    procedure.finish()


def with_gain(hand: Hand, its: Fit, made_s: int) -> Calibration:
    """The finger's calibration as it is on the board, with K in it, for the sensor that is there."""
    own = hand.calibration(its.finger)
    if own is None or hand.calibration_state(its.finger) != wire.CalibrationState.IN_FORCE:
        own = Calibration().changed(hand.settings())
    return replace(own, pressure_gain_nn=its.gain_nn, serial=_serial(hand, its.finger), made_s=made_s)


def put(hand: Hand, finger: int, calibration: Calibration) -> None:
    """Set it and read it back. Not while streaming. Raises CommandRefusedError, or InputError if it is another then."""
    hand.set_calibration(finger, calibration)
    back = hand.calibration(finger)
    if back != calibration or hand.calibration_state(finger) != wire.CalibrationState.IN_FORCE:
        raise InputError(
            f"finger {finger}: the board says {back}, expected what it was given, in force; read it with "
            "`biotac calibration show`"
        )
