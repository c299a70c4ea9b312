"""A procedure driven by a hand or a recording, and its outcome set on the board and read back."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from .. import _wire as wire
from ..calibration import Calibration
from ..errors import InputError
from ..frames import StructArray
from ..hand import Hand
from ..identity import ascii_text
from ..recording import Recording
from .fit import Fit, fit
from .procedure import CALIBRATION_FORCES_N, VERIFICATION_FORCES_N, Procedure, Step
from .reference import Reference, Series, check_alignment
from .rows import rows_of, with_filter

Show = Callable[[Step | None], None]


def drive(hand: Hand, procedure: Procedure, reference: Reference, show: Show = lambda step: None) -> None:
    """Feed ``procedure`` with what ``hand`` streams until it is done, telling ``show`` each new step.

    Starts the stream if need be and leaves it on. Raises InputError when a finger waits in vain, or a simulated
    source ends first.
    """
    shown: Step | None = procedure.step
    show(shown)
    for batch in hand.batches():
        force_n = reference.at(batch.wire["finger"], batch.t_us)
        procedure.feed(rows_of(batch.wire, batch.t_us, force_n))
        if procedure.step != shown:
            shown = procedure.step
            show(shown)
        if procedure.done:
            return
    procedure.finish()


def recorded_rows(recording: Recording, reference: Reference) -> StructArray:
    """Rows of a whole recording, in the order of arrival. InputError when a Series does not fit its pressure."""
    messages = recording.wire
    if recording.info.wire_minor < 4:
        messages = with_filter(messages, recording.settings[wire.Setting.PRESSURE_FILTER_MILLI])
    t_us = recording.frames["t_us"]
    rows = rows_of(messages, t_us, reference.at(messages["finger"], t_us))
    if isinstance(reference, Series) and len(rows) and np.isnan(rows["force_n"]).all():
        first_s, last_s = t_us.min() / 1e6, t_us.max() / 1e6
        raise InputError(
            f"{reference.name} covers none of {len(rows)} frames, which are from {first_s:.2f} to {last_s:.2f} s of the "
            "board's time; expected t_s in that time (its t_us / 1e6)"
        )
    return rows


def from_recording(
    recording: Recording, reference: Reference, fingers: Sequence[int], forces_n: Sequence[float] | None = None
) -> tuple[Procedure, dict[int, int]]:
    """Run a recording's presses, the last of each finger for verification; and each finger's lag in rows.

    ``forces_n``: what a scale told at each press, when there is no reference over time.
    """
    rows = recorded_rows(recording, reference)
    asked = forces_n or (*CALIBRATION_FORCES_N, *VERIFICATION_FORCES_N)
    procedure = Procedure(fingers, asked, needs_force=forces_n is None)
    lags = {}
    if isinstance(reference, Series):
        for finger in fingers:
            mine = rows[rows["finger"] == finger]
            lags[finger] = check_alignment(f"finger {finger}", mine["pressure"] - mine["rest"], mine["force_n"])
    procedure.feed(rows)
    procedure.finish()
    return procedure, lags


def fits_of(procedure: Procedure, presses: int | None = None) -> dict[int, Fit]:
    """K of each finger from its first ``presses`` presses, by default all. Raises InputError, see ``fit``."""
    return {f: fit(procedure.rests[f], mine[:presses]) for f, mine in procedure.presses.items()}


def with_gain(hand: Hand, its: Fit, made_s: int) -> Calibration:
    """The finger's calibration as it is on the board, with K in it, for the sensor that is there."""
    own = hand.calibration(its.finger)
    if own is None or hand.calibration_state(its.finger) != wire.CalibrationState.IN_FORCE:
        own = Calibration().changed(hand.settings())
    told = hand.sensor_info(its.finger)
    return replace(own, pressure_gain_nn=its.gain_nn, serial=ascii_text(told.serial), made_s=made_s)


def put(hand: Hand, finger: int, calibration: Calibration) -> None:
    """Set it and read it back. Not while streaming. Raises CommandRefusedError, or InputError if it is another then."""
    hand.set_calibration(finger, calibration)
    back = hand.calibration(finger)
    if back != calibration or hand.calibration_state(finger) != wire.CalibrationState.IN_FORCE:
        raise InputError(
            f"finger {finger}: the board says {back}, expected what it was given, in force; read it with "
            "`biotac calibration show`"
        )
