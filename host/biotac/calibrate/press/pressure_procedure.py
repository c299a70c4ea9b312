"""Pressure calibration on a board, K written to it and read back, and from a recording; one more press verifies K.

A board takes no calibration while it streams, so the stream is stopped between the presses and the verification. The
time of an unpaced emulated board would run on meanwhile, so such a board is opened again, and in its second run
everything up to the end of the first presses is ignored.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...errors import CommandRefusedError, InputError
from ...hand.hand import Hand
from ...keep import Calibration
from ...recording import Recording
from ...wire import messages_gen as wire
from ...wire.frames import StructArray
from ...wire.identity import ascii_text, serial_text
from .detector import Procedure
from .force_source import Reference, Series, Truth, check_alignment
from .guide import Face, guide
from .pressure import (
    CALIBRATION_FORCES_N,
    MIN_PRESSES,
    VERIFICATION_FORCES_N,
    Fit,
    Outcome,
    fit,
    provenance,
    verify,
    with_board_force,
)
from .rows import rows_of

AROUND_ROWS = 50  # before and after a touch, in which the plate's force is taken as this finger's


@dataclass(frozen=True)
class Plan:
    """The fingers (none: all with a sensor) and the forces in N to ask for."""

    fingers: tuple[int, ...] = ()
    forces_n: tuple[float, ...] = CALIBRATION_FORCES_N
    verification_n: tuple[float, ...] = VERIFICATION_FORCES_N


# ---- on a board --------------------------------------------------------------------------------


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
        presses = guide(hand, procedure, reference, face)
        fits = {finger: fit(procedure.rests[finger], held) for finger, held in presses.items()}
        if reference is None or hand.link.pace != 0:
            hand.stop()
            return _verified(hand, fits, serials, reference, face, plan, made_s, save=save, after_us=0)
        lasted_us = max(int(press.rows["t_us"][-1]) for held in presses.values() for press in held) - reference.first_us
    with open_hand() as hand:
        assert hand.link.source is not None
        second = Truth(hand.link.source)
        return _verified(hand, fits, serials, second, face, plan, made_s, save=save, after_us=lasted_us)


def _verified(
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
    calibrations, origins = {}, {}
    for finger, fitted in fits.items():
        now = _serial(hand, finger)
        if now != serials[finger]:
            raise InputError(
                f"finger {finger} is now sensor {now!r}, but was {serials[finger]!r} during the presses; expected "
                "the same; start again"
            )
        calibrations[finger] = with_gain(hand, fitted, made_s)
        origins[finger] = provenance(fitted, **{"from": hand.port, "board_serial": serial_text(hand.info)})
        put(hand, finger, calibrations[finger])
    procedure = Procedure(list(fits), plan.verification_n, needs_force=reference is not None)
    held = guide(hand, procedure, reference, face, after_us=after_us)
    verified = {finger: verify(fits[finger], presses[-1]) for finger, presses in held.items()}
    hand.stop()
    not_saved = None
    if save:
        try:
            hand.save_settings()
        except CommandRefusedError as error:
            not_saved = error  # the presses are not lost for this
    return Outcome(fits, calibrations, origins, verified, not_saved=not_saved)


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


def with_gain(hand: Hand, fitted: Fit, made_s: int) -> Calibration:
    """The finger's calibration on the board with K put in, for the sensor that is connected."""
    own = hand.calibration(fitted.finger)
    if own is None or hand.calibration_state(fitted.finger) != wire.CalibrationState.IN_FORCE:
        own = Calibration().changed(hand.settings())
    return replace(own, pressure_gain_nn=fitted.gain_nn, serial=_serial(hand, fitted.finger), made_s=made_s)


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


# ---- from a recording --------------------------------------------------------------------------


def calibrate_recording(
    recording: Recording,
    reference: Series | None,
    *,
    fingers: Sequence[int] = (),
    forces_n: Sequence[float] = (),
    made_s: int = 0,
) -> Outcome:
    """K of each of ``fingers`` (none: all in the recording), from all of its presses but the last, which verifies it.

    ``reference`` has the force over the board's time; without it ``forces_n`` are what a scale showed at each press,
    including the last. The board's force at the last press is computed by the board's own code. Raises InputError for
    data that does not give K.
    """
    if reference is None and not forces_n:
        raise InputError(
            f"{recording.path}: no force to calibrate against; expected a reference file, or the force of each press"
        )
    asked = tuple(forces_n) or (*CALIBRATION_FORCES_N, *VERIFICATION_FORCES_N)
    if len(asked) < MIN_PRESSES + 1:
        raise InputError(
            f"{len(asked)} forces given, expected {MIN_PRESSES + 1} or more: one per press, the last for verification"
        )
    rows = _rows(recording, reference)
    there = np.unique(rows["finger"]).tolist()
    absent = sorted(set(fingers) - set(there))
    if absent or not there:
        raise InputError(
            f"{recording.path} has no frames from finger {absent[0] if absent else 0}; fingers in it: "
            f"{', '.join(map(str, there)) or 'none at all'}"
        )
    serials = {sensor.finger: ascii_text(sensor.serial) for sensor in recording.sensors}
    source = {
        "from": recording.path.name,
        "sha256": hashlib.sha256(recording.path.read_bytes()).hexdigest(),
        "reference": reference.name if reference is not None else "typed",
    }
    outcome = Outcome({}, {}, {}, {}, {})
    for finger in fingers or there:
        own_rows = rows[rows["finger"] == finger]
        if reference is not None:
            outcome.lag_rows[finger] = _lag(recording, own_rows, finger)
        # A procedure for each finger: a recording may have them in any order.
        procedure = Procedure([finger], asked, needs_force=reference is not None)
        presses = procedure.find(own_rows)[finger]
        if reference is None:
            presses = [press.with_force(force) for press, force in zip(presses, forces_n, strict=True)]
        fitted = fit(procedure.rests[finger], presses[:-1])
        own = recording.calibrations.get(finger) or Calibration().changed(recording.settings)
        outcome.fits[finger] = fitted
        outcome.verified[finger] = verify(fitted, with_board_force(presses[-1], fitted.gain_nn))
        outcome.calibrations[finger] = replace(
            own, pressure_gain_nn=fitted.gain_nn, serial=serials.get(finger, ""), made_s=made_s
        )
        outcome.provenance[finger] = provenance(fitted, **source)
    return outcome


def _rows(recording: Recording, reference: Series | None) -> StructArray:
    t_us = recording.frames["t_us"]
    rows = rows_of(recording.wire, t_us, reference)
    if reference is not None and len(rows) and np.isnan(rows["force_n"]).all():
        first_s, last_s = t_us.min() / 1e6, t_us.max() / 1e6
        raise InputError(
            f"{reference.name} covers none of {len(rows)} frames, which span {first_s:.2f} to {last_s:.2f} s of "
            "the board's time; expected t_s within it (t_us / 1e6)"
        )
    return rows


def _lag(recording: Recording, rows: StructArray, finger: int) -> int:
    # All fingers share one plate: its force is this finger's only around its own touches.
    near = np.convolve(rows["touched"], np.ones(2 * AROUND_ROWS + 1), "same") > 0
    above = np.where(near, rows["pressure"] - rows["rest"], np.nan)
    return check_alignment(f"{recording.path}, finger {finger}", above, rows["force_n"])
