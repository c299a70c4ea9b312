"""Pressure calibration on a board: presses, K written to the board and read back, and a verification press with it.

A board takes no calibration while it streams, so the stream is stopped between the presses and the verification. The
time of an unpaced emulated board would run on meanwhile, so such a board is opened again, and in its second run
everything up to the end of the first presses is ignored.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from ...errors import CommandRefusedError, InputError
from ...hand.hand import Hand
from ...keep import Calibration
from ...wire import messages_gen as wire
from ...wire.batches import Batch
from ...wire.identity import ascii_text, serial_text
from . import report
from .fit import MIN_PRESSES, Fit, fit, verify
from .force_source import Reference, Truth
from .presses import CALIBRATION_FORCES_N, VERIFICATION_FORCES_N, Phase, Press, Procedure, Step
from .report import Outcome
from .rows import rows_of


class Face(Protocol):
    """The user interface of a guided procedure."""

    def show(self, step: Step | None) -> None:
        """Show the next thing to do; None when all is done."""

    def force_n(self, step: Step) -> float:
        """The force in N that the scale shows at the press just held; asked only without a reference."""


@dataclass(frozen=True)
class Plan:
    """The fingers (none: all with a sensor) and the forces in N to ask for."""

    fingers: tuple[int, ...] = ()
    forces_n: tuple[float, ...] = CALIBRATION_FORCES_N
    verification_n: tuple[float, ...] = VERIFICATION_FORCES_N


def calibrate(open_hand: Callable[[], Hand], plan: Plan, face: Face, *, made_s: int, save: bool = False) -> Outcome:
    """Run ``plan`` on the board that ``open_hand`` opens; the force is its scenario's, or what ``face`` gives.

    ``save`` keeps the result over reboots once every finger is verified; see Outcome.not_saved if the board refuses.
    Raises InputError for presses that cannot be used, for a finger without a sensor, and for a sensor that was changed
    meanwhile; the board then keeps nothing beyond the next reboot.
    """
    if len(plan.forces_n) < MIN_PRESSES:
        raise InputError(f"{len(plan.forces_n)} presses are planned, expected {MIN_PRESSES} or more; name more forces")
    with open_hand() as hand:
        fingers = _fingers(hand, plan)
        serials = {finger: _serial(hand, finger) for finger in fingers}
        reference = None if hand.link.source is None else Truth(hand.link.source)
        procedure = Procedure(fingers, plan.forces_n, needs_force=reference is not None)
        presses = _run(hand, procedure, reference, face)
        fits = {finger: fit(procedure.rests[finger], mine) for finger, mine in presses.items()}
        if reference is None or hand.link.pace != 0:
            hand.stop()
            return _on_board(hand, fits, serials, reference, face, plan, made_s, save=save, after_us=0)
        lasted_us = max(int(press.rows["t_us"][-1]) for held in presses.values() for press in held) - reference.first_us
    with open_hand() as hand:
        assert hand.link.source is not None
        second = Truth(hand.link.source)
        return _on_board(hand, fits, serials, second, face, plan, made_s, save=save, after_us=lasted_us)


def _run(
    hand: Hand, procedure: Procedure, reference: Reference | None, face: Face, *, after_us: int = 0
) -> dict[int, list[Press]]:
    typed: dict[tuple[int, int], float] = {}

    def show(step: Step | None) -> None:
        if reference is None:
            ask_forces(procedure, typed, face)
        face.show(step)

    drive(hand, procedure, reference, show, after_us=after_us)
    return {
        finger: [press.with_force(typed[finger, press.number]) if typed else press for press in held]
        for finger, held in procedure.presses.items()
    }


def ask_forces(procedure: Procedure, typed: dict[tuple[int, int], float], face: Face) -> None:
    """Ask ``face`` for the force of every press without one: several, when somebody presses faster than they type."""
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
    reference: Reference | None,
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
                f"finger {finger} is now sensor {now!r}, but was {serials[finger]!r} during the presses; expected "
                "the same; start again"
            )
        calibrations[finger] = with_gain(hand, its, made_s)
        provenance[finger] = report.provenance(its, **{"from": hand.port, "board_serial": serial_text(hand.info)})
        put(hand, finger, calibrations[finger])
    procedure = Procedure(list(fits), plan.verification_n, needs_force=reference is not None)
    held = _run(hand, procedure, reference, face, after_us=after_us)
    verified = {finger: verify(fits[finger], presses[-1]) for finger, presses in held.items()}
    hand.stop()
    not_saved = None
    if save:
        try:
            hand.save_settings()
        except CommandRefusedError as error:
            not_saved = error  # the presses are not lost for this
    return Outcome(fits, calibrations, provenance, verified, not_saved=not_saved)


def _fingers(hand: Hand, plan: Plan) -> Sequence[int]:
    absent = sorted(set(plan.fingers) - set(hand.fingers))
    if absent or not hand.fingers:
        there = ", ".join(map(str, hand.fingers)) or "none"
        which = absent[0] if absent else "0 to 4"
        raise InputError(
            f"no sensor on finger {which} ({there} {'is' if not hand.fingers else 'are'} there); check its cable"
        )
    return plan.fingers or tuple(hand.fingers)


def _serial(hand: Hand, finger: int) -> str:
    return ascii_text(hand.sensor_info(finger).serial)


def drive(
    hand: Hand,
    procedure: Procedure,
    reference: Reference | None,
    show: Callable[[Step | None], None] = lambda step: None,
    *,
    after_us: int = 0,
    heard: Callable[[Batch], None] = lambda batch: None,
) -> None:
    """Feed ``procedure`` with what ``hand`` streams until it is done, and give ``show`` each new step.

    Starts the stream if necessary and leaves it on. ``heard`` gets every batch; ``procedure`` does not get the first
    ``after_us`` of device time. Raises InputError when a finger waits too long, or a simulated source ends first.
    """
    shown: Step | None = procedure.step
    show(shown)
    first_us: int | None = None
    for batch in hand.batches():
        heard(batch)
        rows = rows_of(batch.wire, batch.t_us, reference)
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
    """The finger's calibration on the board with K put in, for the sensor that is connected."""
    own = hand.calibration(its.finger)
    if own is None or hand.calibration_state(its.finger) != wire.CalibrationState.IN_FORCE:
        own = Calibration().changed(hand.settings())
    return replace(own, pressure_gain_nn=its.gain_nn, serial=_serial(hand, its.finger), made_s=made_s)


def put(hand: Hand, finger: int, calibration: Calibration) -> None:
    """Set the calibration and read it back. Not while streaming.

    Raises CommandRefusedError, or InputError when the board returns another calibration or does not use it.
    """
    hand.set_calibration(finger, calibration)
    back = hand.calibration(finger)
    if back != calibration or hand.calibration_state(finger) != wire.CalibrationState.IN_FORCE:
        raise InputError(
            f"finger {finger}: the board returns {back}, expected the calibration it was given, in force; check with "
            "`biotac calibration show`"
        )
