"""A procedure driven by a hand, and its outcome set on the board and read back."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from ...errors import InputError
from ...hand.hand import Hand
from ...keep import Calibration
from ...wire import messages_gen as wire
from ...wire.identity import ascii_text
from .fit import Fit, fit
from .plateaus import Press
from .procedure import Procedure, Step
from .reference import Reference
from .rows import rows_of

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


def fits_of(procedure: Procedure, presses: Mapping[int, Sequence[Press]]) -> dict[int, Fit]:
    """K of each finger from these of its presses. Raises InputError, see ``fit``."""
    return {finger: fit(procedure.rests[finger], mine) for finger, mine in presses.items()}


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
