"""Pressure calibration on a board and from a recording: K from a finger's presses, verified on the last one.

The board's force at that press is computed by the board's own code, from the board's filtered pressure and tare. A
board accepts no calibration while it streams, so it gets K after the last press.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...clock.alignment import PDC_S, Alignment, align, means
from ...errors import InputError
from ...hand.hand import Hand
from ...keep import Calibration
from ...recording.reader import Recording
from ...wire import messages_gen as wire
from ...wire.frames import StructArray
from ...wire.identity import ascii_text, serial_text
from ..reference.samples import Reference
from .detector import Procedure, find
from .force_source import rows_of, truth_of
from .guide import Prompt, guide
from .pressure import CALIBRATION_FORCES_N, MIN_PRESSES, VERIFICATION_FORCES_N, Calibrated, PressureFit, fit_and_verify


def calibrate(
    hand: Hand, prompt: Prompt, *, fingers: Sequence[int] = (), made_s: int, force: bool = False
) -> list[Calibrated]:
    """K of each of ``fingers`` (none: all) on a board, from the paper's presses; in force until the next reboot.

    One with a reason ``why_not`` is not put into force, except with ``force``. The force is the scenario's, or the
    ``prompt``'s. Raises InputError for presses that cannot be used, for a finger without a sensor, and for a sensor
    that was changed meanwhile.
    """
    absent = sorted(set(fingers) - set(hand.fingers))
    if absent or not hand.fingers:
        present = f"{', '.join(map(str, hand.fingers))} are" if hand.fingers else "none is"
        raise InputError(f"no sensor on finger {absent[0] if absent else '0 to 4'} ({present} there); check its cable")
    fingers = fingers or hand.fingers
    serials = {finger: _serial(hand, finger) for finger in fingers}
    reference = truth_of(hand)
    procedure = Procedure(fingers, CALIBRATION_FORCES_N, VERIFICATION_FORCES_N, needs_force=reference is not None)
    held = guide(hand, procedure, reference, prompt)
    hand.stop()
    source = {"from": hand.port, "board_serial": serial_text(hand.info)}
    calibrated = []
    for finger, presses in held.items():
        now = _serial(hand, finger)
        if now != serials[finger]:
            raise InputError(
                f"finger {finger} is now sensor {now!r}, but was {serials[finger]!r} when it began; expected the same; "
                "start again"
            )
        fitted, verified = fit_and_verify(procedure.rests[finger], presses)
        calibrated.append(Calibrated(fitted, verified, with_gain(hand, fitted, made_s), source))
        if force or not calibrated[-1].why_not:
            put(hand, finger, calibrated[-1].calibration)
    return calibrated


def _serial(hand: Hand, finger: int) -> str:
    return ascii_text(hand.sensor_info(finger).serial)


def with_gain(hand: Hand, fitted: PressureFit, made_s: int) -> Calibration:
    """The finger's calibration on the board with K put in, for the sensor that is connected."""
    own = hand.board.calibration(fitted.finger)
    if own is None or hand.board.calibration_state(fitted.finger) != wire.CalibrationState.IN_FORCE:
        own = Calibration().changed(hand.board.settings())
    return replace(own, pressure_gain_nn=fitted.gain_nn, serial=_serial(hand, fitted.finger), made_s=made_s)


def put(hand: Hand, finger: int, calibration: Calibration) -> None:
    """Set the calibration and read it back. Not while streaming.

    Raises CommandRefusedError, or InputError when the board returns another calibration or does not use it.
    """
    hand.board.set_calibration(finger, calibration)
    back = hand.board.calibration(finger)
    if back != calibration or hand.board.calibration_state(finger) != wire.CalibrationState.IN_FORCE:
        raise InputError(
            f"finger {finger}: the board returns {back}, expected the calibration it was given, in force; check with "
            "`biotac calibrate show`"
        )


def calibrate_recording(
    recording: Recording,
    reference: Reference | None,
    *,
    fingers: Sequence[int] = (),
    forces_n: Sequence[float] = (),
    made_s: int = 0,
) -> list[Calibrated]:
    """K of each of ``fingers`` (none: all in the recording), from all presses but the last, which verifies it.

    ``reference`` is that of all fingers, in any sensor's axes; without it ``forces_n`` are a scale's at each press,
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
    rows = rows_of(recording.wire, recording.frames["t_us"])
    present = np.unique(rows["finger"]).tolist()
    absent = sorted(set(fingers) - set(present))
    if absent or not present:
        raise InputError(
            f"{recording.path} has no frames from finger {absent[0] if absent else 0}; fingers in it: "
            f"{', '.join(map(str, present)) or 'none at all'}"
        )
    serials = {sensor.finger: ascii_text(sensor.serial) for sensor in recording.sensors}
    source = {
        "from": recording.path.name,
        "sha256": hashlib.sha256(recording.path.read_bytes()).hexdigest(),
        "reference": reference.name if reference is not None else "typed",
    }
    alignment = None if reference is None else _add_force(str(recording.path), rows, reference)
    calibrated = []
    for finger in fingers or present:
        own_rows, shown_n = rows[rows["finger"] == finger], forces_n if reference is None else ()
        rest, presses = find(finger, own_rows, len(asked), needs_force=reference is not None, shown_n=shown_n)
        fitted, verified = fit_and_verify(rest, presses)
        own = recording.calibrations.get(finger) or Calibration().changed(recording.settings)
        own = replace(own, pressure_gain_nn=fitted.gain_nn, serial=serials.get(finger, ""), made_s=made_s)
        calibrated.append(Calibrated(fitted, verified, own, source, alignment))
    return calibrated


def _add_force(where: str, rows: StructArray, reference: Reference) -> Alignment:
    """Put the reference's force into ``rows``. All fingers share one plate, and so one alignment of their pressures."""
    t_s, at_s = reference.samples.t_s, rows["t_us"] / 1e6 + PDC_S
    size_n = np.linalg.norm(reference.samples.wrench[:, :3], axis=1)
    alignment = align(where, at_s, rows["pressure"] - rows["rest"], t_s, size_n)
    rows["force_n"] = means(t_s, size_n[:, None], alignment.to_reference_s(at_s))[:, 0]
    return alignment
