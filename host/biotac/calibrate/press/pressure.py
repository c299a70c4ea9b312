"""K of a finger's pressure from presses, the error on another press, and the limits of a K.

F = (P - P0) K          Eq 1 of Navarro et al. 2015
K = pinv(P - P0) |F|    Eq 6, over the held rows of all presses
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ...clock.alignment import Alignment
from ...documents import DOUBT, Provenance
from ...errors import InputError
from ...keep import Calibration
from ...kernels.compiled import NN_PER_N, pressure_force_100un
from ...kernels.geometry import Floats
from ...version import __version__
from ...wire import messages_gen as wire
from ...wire.frames import FORCE_LSB_PER_N, Q4_PER_COUNT, to_units
from .detector import Press, Rest

#: Forces to ask for, N. The paper asks for joint angles of 18, 20 and 22 degrees, "with increasing pressure".
CALIBRATION_FORCES_N = (2.0, 3.5, 5.0)
VERIFICATION_FORCES_N = (4.0,)
MIN_PRESSES = 3
PAPER_ERROR = 0.0591  # relative error of the fore finger's verification press
WRONG_ERROR = 0.25  # K at another place is off by 24 % at most; with more, something was typed or pressed wrongly
# The paper found 0.009 to 0.016 N per count. A third of the smallest and three times the largest are likelier another
# unit; a tenth of the smallest, and six times the largest, which is a board's limit, cannot be right at all.
USUAL_GAIN_N = (0.003, 0.05)
GAIN_MIN_N = 0.0009
GAIN_MAX_N = wire.SETTINGS[wire.Setting.PRESSURE_GAIN_NN].high / NN_PER_N
#: The gains of single presses may be this far apart, as a share of K, before the fit is refused. A press at another
#: place or with another alignment shows up here.
SPREAD_MAX = 0.5
SPREAD_NOTED = 0.1


@dataclass(frozen=True)
class PressureFit:
    """One finger's fit: ``gain_n`` is K in N per count, ``rest`` has P0, ``press_gains_n`` is K of each press alone."""

    finger: int
    gain_n: float
    rest: Rest
    rows: int
    press_counts: tuple[float, ...]
    press_forces_n: tuple[float, ...]
    press_gains_n: tuple[float, ...]
    relative_error: float
    notes: tuple[str, ...] = ()

    @property
    def gain_nn(self) -> int:
        """K as the board stores it, in whole nN per count."""
        return round(self.gain_n * NN_PER_N)

    @property
    def why_not(self) -> str:
        """Why K should not be used; empty if it should."""
        low, high = USUAL_GAIN_N
        if low <= self.gain_n <= high:
            return ""
        return (
            f"finger {self.finger}: K is {self.gain_n:.3g} N/count, expected {low:g} to {high:g}; name the unit that "
            "the force was in (--unit kg or g), or convert it to newtons"
        )


@dataclass(frozen=True)
class Verification:
    """Errors on one more press.

    ``board_error`` is the relative error of the board's force ``board_n``, ``float_error`` that of Eq 1 in float64 from
    the same frames, ``apart_n`` the largest difference between the two forces in N.
    """

    force_n: float
    board_n: float
    board_error: float
    float_error: float
    apart_n: float


def fit(rest: Rest, presses: Sequence[Press]) -> PressureFit:
    """K of one finger. Raises InputError, with the number that shows why, for presses that do not give K."""
    finger = presses[0].finger if presses else -1
    where = f"finger {finger}"
    if len(presses) < MIN_PRESSES:
        raise InputError(f"{where}: {len(presses)} presses, expected at least {MIN_PRESSES}; press again")
    for press in presses:
        _check(where, press)
    above = np.concatenate([press.above_rest for press in presses])
    force = np.concatenate([press.rows["force_n"] for press in presses])
    gain_n = gain_of(above, force)
    if not GAIN_MIN_N <= gain_n <= GAIN_MAX_N:
        raise InputError(
            f"{where}: K is {gain_n:.3g} N/count, expected {GAIN_MIN_N:g} to {GAIN_MAX_N:g}; is the reference in "
            "newtons, and this press's?"
        )
    gains = [gain_of(press.above_rest, press.rows["force_n"]) for press in presses]
    spread = (max(gains) - min(gains)) / gain_n
    if spread > SPREAD_MAX:
        raise InputError(
            f"{where}: K of single presses is {min(gains):.4g} to {max(gains):.4g} N/count, a spread of {spread:.0%}, "
            f"expected at most {SPREAD_MAX:.0%}; is the reference for this finger, and were all presses at one place?"
        )
    note = f"{where}: K of single presses spreads by {spread:.0%}: it depends on the force or the place"
    return PressureFit(
        finger=finger,
        gain_n=gain_n,
        rest=rest,
        rows=len(above),
        press_counts=tuple(float(press.above_rest.mean()) for press in presses),
        press_forces_n=tuple(float(press.rows["force_n"].mean()) for press in presses),
        press_gains_n=tuple(gains),
        relative_error=relative_error(above * gain_n, force),
        notes=(note,) if spread > SPREAD_NOTED else (),
    )


def verify(fitted: PressureFit, press: Press) -> Verification:
    """Compare the board's own force in a press, and float64's, with the reference. Raises InputError without one."""
    _check(f"finger {fitted.finger}", press)
    exact = press.above_rest * (fitted.gain_nn / NN_PER_N)
    board, force = press.rows["board_n"], press.rows["force_n"]
    return Verification(
        force_n=float(force.mean()),
        board_n=float(board.mean()),
        board_error=relative_error(board, force),
        float_error=relative_error(exact, force),
        apart_n=float(np.abs(board - exact).max()),
    )


def with_board_force(press: Press, gain_nn: int) -> Press:
    """The press with the force that a board with this gain gives, by the board's own code; for recordings without."""
    rows = press.rows
    filtered_q4, rest_q4 = (np.rint(rows[name] * Q4_PER_COUNT).astype(np.uint16) for name in ("pressure", "rest"))
    return press.with_column("board_n", to_units(pressure_force_100un(filtered_q4, rest_q4, gain_nn), FORCE_LSB_PER_N))


def gain_of(above_rest: Floats, force_n: Floats) -> float:
    """Eq 6: K in N per count, the pseudo-inverse of the column P - P0 (n,) times F (n,) in N."""
    return float((np.linalg.pinv(above_rest[:, None]) @ force_n)[0])


def relative_error(seen_n: Floats, force_n: Floats) -> float:
    """|seen - F| / |F| over a press, both (n,) in N; the bars are Euclidean norms.

    The paper gives a "relative error" of 5.91 % without a formula. This one includes scatter from row to row, which a
    mean would hide.
    """
    return float(np.linalg.norm(seen_n - force_n) / np.linalg.norm(force_n))


def _check(where: str, press: Press) -> None:
    force = press.rows["force_n"]
    if not (force > 0).all():  # NaN is not either
        raise InputError(
            f"{where}, press {press.number}: the reference is {float(force.min()):.3g} N while pressure is "
            f"{press.above_rest.mean():.0f} counts above rest, expected a magnitude above 0; zero it at rest, and "
            "check that it covers and belongs to this press"
        )


# ---- results -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Calibrated:
    """One finger's K, the error on the verification press, the calibration with it, and the source of the presses.

    ``alignment`` is that of a reference with a clock of its own, None for a force without.
    """

    fit: PressureFit
    verified: Verification
    calibration: Calibration
    source: Provenance
    alignment: Alignment | None = None

    @property
    def why_not(self) -> str:
        """Why it should not be put into force; empty if it should."""
        if self.fit.why_not or self.verified.board_error <= WRONG_ERROR:
            return self.fit.why_not
        return (
            f"finger {self.fit.finger}: {self.verified.board_error:.0%} off on the verification press, expected "
            f"at most {WRONG_ERROR:.0%}; check what the scale showed at each press, and press at one place"
        )

    @property
    def provenance(self) -> Provenance:
        """How the calibration was made."""
        made = {"software": f"biotac-gateway {__version__}", "method": "pressure, Navarro 2015"}
        doubt = {DOUBT: self.why_not} if self.why_not else {}
        return made | self.source | _numbers(self.fit) | doubt


def fit_and_verify(rest: Rest, presses: Sequence[Press]) -> tuple[PressureFit, Verification]:
    """A finger's fit to all presses but the last, and that press by the board's own code. Raises as fit()."""
    fitted = fit(rest, presses[:-1])
    return fitted, verify(fitted, with_board_force(presses[-1], fitted.gain_nn))


def _numbers(fitted: PressureFit) -> Provenance:
    return {
        "finger": fitted.finger,
        "gain_n": fitted.gain_n,
        "rest_counts": round(fitted.rest.counts, 2),
        "rows": fitted.rows,
        "press_forces_n": [round(force, 4) for force in fitted.press_forces_n],
        "press_counts": [round(counts, 2) for counts in fitted.press_counts],
        "press_gains_n": [round(gain, 7) for gain in fitted.press_gains_n],
        "relative_error": round(fitted.relative_error, 5),
    }


def facts(fingers: Sequence[Calibrated]) -> list[dict[str, Any]]:
    """One object for each finger, in JSON types."""
    digits = {"force_n": 4, "board_n": 4, "board_error": 5, "float_error": 5, "apart_n": 7}
    return [
        _numbers(finger.fit)
        | {
            "serial": finger.calibration.serial,
            "pressure_gain_nn": finger.fit.gain_nn,
            "notes": list(finger.fit.notes),
            "why_not": finger.why_not,
            "verification": {key: round(getattr(finger.verified, key), n) for key, n in digits.items()},
        }
        | ({} if finger.alignment is None else {"alignment": asdict(finger.alignment)})
        for finger in fingers
    ]


def lines(fingers: Sequence[Calibrated]) -> list[str]:
    """The table of K and P0, with the verification press."""
    out = ["finger  sensor            K N/count  P0 count     fit  force N  board N   error  float64"]
    notes: list[str] = []
    for finger in fingers:
        fitted, seen = finger.fit, finger.verified
        out.append(
            f"{fitted.finger:>6}  {finger.calibration.serial or 'any':<16}  {fitted.gain_n:>9.6f}"
            f"  {fitted.rest.counts:>8.1f}  {fitted.relative_error:>6.2%}  {seen.force_n:>7.3f}  {seen.board_n:>7.3f}"
            f"  {seen.board_error:>6.2%}  {seen.float_error:>7.2%}"
        )
        notes += fitted.notes
        if finger.why_not:
            notes.append(finger.why_not)
        elif seen.board_error > PAPER_ERROR:
            notes.append(
                f"finger {fitted.finger}: {seen.board_error:.1%} off on the verification press (the paper's: "
                f"{PAPER_ERROR:.2%}): was it at another place, or pressed in another way?"
            )
    notes += dict.fromkeys(str(finger.alignment) for finger in fingers if finger.alignment)
    return [*out, *(f"  {note}" for note in notes)]
