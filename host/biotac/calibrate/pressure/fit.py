"""K of a finger from its presses (Eq 6), its error on another press, and what is refused."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...core.compiled import NN_PER_N, pressure_force_100un
from ...errors import InputError
from ...wire import messages_gen as wire
from ...wire.frames import FORCE_LSB_PER_N, Q4_PER_COUNT, to_units
from . import formulas
from .presses import HOLD_ROWS, Press, Rest

MIN_PRESSES = 3
# The paper found 0.009 to 0.016 N per count. The limits are a tenth of the smallest, and what a board accepts, six
# times the largest: beyond these something else is wrong.
GAIN_MIN_N = 0.0009
GAIN_MAX_N = wire.SETTINGS[wire.Setting.PRESSURE_GAIN_NN].high / NN_PER_N
#: The gains of single presses may be this far apart, as a share of K, before the fit is refused. A press at another
#: place or with another alignment shows up here.
SPREAD_MAX = 0.5
SPREAD_NOTED = 0.1


@dataclass(frozen=True)
class Fit:
    """One finger's fit: ``gain_n`` is K in N per count, ``rest`` has P0, ``press_gains_n`` is K of each press alone."""

    finger: int
    gain_n: float
    rest: Rest
    rows: int
    press_counts: tuple[float, ...]
    press_forces_n: tuple[float, ...]
    press_gains_n: tuple[float, ...]
    relative_error: float
    notes: tuple[str, ...] = field(default=())

    @property
    def gain_nn(self) -> int:
        """K as the board keeps it, in whole nN per count."""
        return round(self.gain_n * NN_PER_N)


@dataclass(frozen=True)
class Verification:
    """Errors on one more press.

    ``board_error`` is the relative error of the board's force, ``float_error`` that of Eq 1 in float64 from the same
    frames, ``apart_n`` the largest difference between the two forces in N.
    """

    finger: int
    force_n: float
    told_n: float
    board_error: float
    float_error: float
    apart_n: float


def fit(rest: Rest, presses: Sequence[Press]) -> Fit:
    """K of one finger. Raises InputError, with the number that shows why, for presses that do not give K."""
    finger = presses[0].finger if presses else -1
    where = f"finger {finger}"
    if len(presses) < MIN_PRESSES:
        raise InputError(f"{where}: {len(presses)} presses, expected at least {MIN_PRESSES}; press again")
    for press in presses:
        _check(where, press)
    above = np.concatenate([press.above_rest for press in presses])
    force = np.concatenate([press.rows["force_n"] for press in presses])
    gain_n = formulas.gain(above, force)
    if gain_n <= 0:
        raise InputError(
            f"{where}: K is {gain_n:.3g} N/count: force falls while pressure rises; expected both to rise; is the "
            "reference from another press, or its sign wrong?"
        )
    if not GAIN_MIN_N <= gain_n <= GAIN_MAX_N:
        raise InputError(
            f"{where}: K is {gain_n:.3g} N/count, expected {GAIN_MIN_N:g} to {GAIN_MAX_N:g}; is "
            "the reference in newtons?"
        )
    gains = [formulas.gain(press.above_rest, press.rows["force_n"]) for press in presses]
    spread = (max(gains) - min(gains)) / gain_n
    if spread > SPREAD_MAX:
        raise InputError(
            f"{where}: K of single presses is {min(gains):.4g} to {max(gains):.4g} N/count, a spread of {spread:.0%}, "
            f"expected at most {SPREAD_MAX:.0%}; is the reference for this finger, and were all presses at one place?"
        )
    notes = []
    if spread > SPREAD_NOTED:
        notes.append(f"{where}: K of single presses spreads by {spread:.0%}: it depends on the force or the place")
    return Fit(
        finger=finger,
        gain_n=gain_n,
        rest=rest,
        rows=len(above),
        press_counts=tuple(float(press.above_rest.mean()) for press in presses),
        press_forces_n=tuple(float(press.rows["force_n"].mean()) for press in presses),
        press_gains_n=tuple(gains),
        relative_error=formulas.relative_error(above * gain_n, force),
        notes=tuple(notes),
    )


def verify(its: Fit, press: Press) -> Verification:
    """Compare the board's own force in a press (``told_n``), and float64's, with the reference.

    Raises InputError when the board gave none in some row, or the reference is unusable.
    """
    where = f"finger {its.finger}"
    _check(where, press)
    told = press.rows["told_n"]
    if np.isnan(told).any():
        raise InputError(
            f"{where}: the board gave no force from pressure in {int(np.isnan(told).sum())} of {len(told)} held rows; "
            "expected its calibration to be in force; see `biotac calibration show`"
        )
    truth = formulas.force(press.rows["pressure"], press.rows["rest"], its.gain_nn / NN_PER_N)
    force = press.rows["force_n"]
    return Verification(
        finger=its.finger,
        force_n=float(force.mean()),
        told_n=float(told.mean()),
        board_error=formulas.relative_error(told, force),
        float_error=formulas.relative_error(truth, force),
        apart_n=float(np.abs(told - truth).max()),
    )


def told_by(press: Press, gain_nn: int) -> Press:
    """The press with ``told_n`` as a board with this gain gives it, by the board's own code; for recordings without."""
    rows = press.rows.copy()
    filtered_q4, rest_q4 = (np.rint(rows[name] * Q4_PER_COUNT).astype(np.uint16) for name in ("pressure", "rest"))
    rows["told_n"] = to_units(pressure_force_100un(filtered_q4, rest_q4, gain_nn), FORCE_LSB_PER_N)
    return Press(press.finger, press.number, rows)


def _check(where: str, press: Press) -> None:
    force = press.rows["force_n"]
    which = f"{where}, press {press.number}"
    if len(force) < HOLD_ROWS:
        raise InputError(f"{which}: {len(force)} held rows, expected at least {HOLD_ROWS}; hold longer")
    if not np.isfinite(force).all():
        bad = int((~np.isfinite(force)).sum())
        raise InputError(
            f"{which}: the reference is NaN in {bad} of {len(force)} rows, expected a force in each; record it longer"
        )
    if not (force > 0).all():
        raise InputError(
            f"{which}: the reference is {float(force.min()):.3g} N while pressure is {press.above_rest.mean():.0f} "
            "counts above rest, expected a magnitude above 0; zero it at rest, and check that it belongs to this press"
        )
