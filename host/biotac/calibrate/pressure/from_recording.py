"""Pressure calibration from a recording: each finger's last press verifies the K from the presses before it."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...errors import InputError
from ...hand.compatibility import PRESSURE_SINCE_MINOR
from ...keep import Calibration
from ...recording import Recording
from ...wire import messages_gen as wire
from ...wire.frames import StructArray
from ...wire.identity import ascii_text
from . import report
from .fit import MIN_PRESSES, fit, told_by, verify
from .force_source import Series, check_alignment
from .presses import CALIBRATION_FORCES_N, VERIFICATION_FORCES_N, Procedure
from .report import Outcome
from .rows import rows_of, with_filter

AROUND_ROWS = 50  # before and after a touch, in which the plate's force is taken as this finger's


def calibrate(
    recording: Recording,
    reference: Series | None,
    *,
    fingers: Sequence[int] = (),
    forces_n: Sequence[float] = (),
    made_s: int = 0,
) -> Outcome:
    """K of each of ``fingers`` (none: all in the recording), from all of its presses but the last.

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
    rows = recorded_rows(recording, reference)
    there = [int(f) for f in np.unique(rows["finger"])]
    absent = sorted(set(fingers) - set(there))
    if absent or not there:
        raise InputError(
            f"{recording.path} has no frames from finger {absent[0] if absent else 0}; fingers in it: "
            f"{', '.join(map(str, there)) or 'none at all'}"
        )
    outcome = Outcome({}, {}, {}, {}, {})
    for finger in fingers or there:
        mine = rows[rows["finger"] == finger]
        if reference is not None:
            outcome.lag_rows[finger] = _lag(recording, mine, finger)
        # A procedure for each finger: a recording may have them in any order.
        procedure = Procedure([finger], asked, needs_force=reference is not None)
        procedure.feed(mine)
        procedure.finish()
        held = procedure.presses[finger]
        if reference is None:
            held = [press.with_force(force) for press, force in zip(held, forces_n, strict=True)]
        its = fit(procedure.rests[finger], held[:-1])
        outcome.fits[finger] = its
        outcome.verified[finger] = verify(its, told_by(held[-1], its.gain_nn))
        own = recording.calibrations.get(finger) or Calibration().changed(recording.settings)
        serial = next((ascii_text(told.serial) for told in recording.sensors if told.finger == finger), "")
        outcome.calibrations[finger] = replace(own, pressure_gain_nn=its.gain_nn, serial=serial, made_s=made_s)
        source = {
            "from": recording.path.name,
            "sha256": hashlib.sha256(recording.path.read_bytes()).hexdigest(),
            "reference": reference.name if reference is not None else "typed",
        }
        outcome.provenance[finger] = report.provenance(its, **source)
    return outcome


def recorded_rows(recording: Recording, reference: Series | None) -> StructArray:
    """ROW_DTYPE rows (n,) of a whole recording, in order of arrival.

    Raises InputError when the reference's times cover none of the recording.
    """
    messages = recording.wire
    if recording.info.wire_minor < PRESSURE_SINCE_MINOR:
        messages = with_filter(messages, recording.settings[wire.Setting.PRESSURE_FILTER_MILLI])
    t_us = recording.frames["t_us"]
    rows = rows_of(messages, t_us, reference)
    if reference is not None and len(rows) and np.isnan(rows["force_n"]).all():
        first_s, last_s = t_us.min() / 1e6, t_us.max() / 1e6
        raise InputError(
            f"{reference.name} covers none of {len(rows)} frames, which span {first_s:.2f} to {last_s:.2f} s of "
            "the board's time; expected t_s within it (t_us / 1e6)"
        )
    return rows


def _lag(recording: Recording, mine: StructArray, finger: int) -> int:
    # All fingers share one plate: its force is this finger's only around its own touches.
    near = np.convolve(mine["touched"], np.ones(2 * AROUND_ROWS + 1), "same") > 0
    above = np.where(near, mine["pressure"] - mine["rest"], np.nan)
    return check_alignment(f"{recording.path}, finger {finger}", above, mine["force_n"])
