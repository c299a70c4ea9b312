"""Results of a pressure calibration: facts for files, lines for people."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ...documents import Provenance
from ...errors import CommandRefusedError
from ...keep import Calibration
from ...version import __version__
from .fit import Fit, Verification

PAPER_ERROR = 0.0591  # relative error of the fore finger's verification press


@dataclass(frozen=True)
class Outcome:
    """Results by finger: K, the calibration with it, its provenance, and the verification press.

    ``lag_rows`` is how many rows pressure lags a reference that has its own times. ``not_saved`` is why the board did
    not save the calibrations, None if it did or was not asked to.
    """

    fits: dict[int, Fit]
    calibrations: dict[int, Calibration]
    provenance: dict[int, Provenance]
    verified: dict[int, Verification]
    lag_rows: dict[int, int] = field(default_factory=dict)
    not_saved: CommandRefusedError | None = None


def provenance(its: Fit, **source: str) -> Provenance:
    """How K was made, for a calibration's file: its ``source`` and the numbers of the fit."""
    made = {"software": f"biotac-gateway {__version__}", "method": "pressure, Navarro 2015"}
    return {**made, **source, **_numbers(its)}


def _numbers(its: Fit) -> Provenance:
    return {
        "finger": its.finger,
        "gain_n": its.gain_n,
        "rest_counts": round(its.rest.counts, 2),
        "rows": its.rows,
        "press_forces_n": [round(force, 4) for force in its.press_forces_n],
        "press_counts": [round(counts, 2) for counts in its.press_counts],
        "press_gains_n": [round(gain, 7) for gain in its.press_gains_n],
        "relative_error": round(its.relative_error, 5),
    }


def facts(outcome: Outcome) -> list[dict[str, Any]]:
    """One object for each finger, in JSON types."""
    out = []
    for finger, its in outcome.fits.items():
        digits = {"force_n": 4, "told_n": 4, "board_error": 5, "float_error": 5, "apart_n": 7}
        seen = outcome.verified[finger]
        one = _numbers(its) | {
            "serial": outcome.calibrations[finger].serial,
            "pressure_gain_nn": its.gain_nn,
            "notes": list(its.notes),
            "verification": {name: round(getattr(seen, name), places) for name, places in digits.items()},
        }
        if finger in outcome.lag_rows:
            one["lag_rows"] = outcome.lag_rows[finger]
        out.append(one)
    return out


def lines(outcome: Outcome) -> list[str]:
    """The table of K and P0, with the verification press."""
    head = f"{'finger':>6}  {'sensor':<16}  {'K N/count':>9}  {'P0 count':>8}  {'fit':>6}"
    out = [head + f"  {'force N':>7}  {'board N':>7}  {'error':>6}  {'float64':>7}"]
    for finger, its in outcome.fits.items():
        serial = outcome.calibrations[finger].serial or "any"
        line = f"{finger:>6}  {serial:<16}  {its.gain_n:>9.6f}  {its.rest.counts:>8.1f}  {its.relative_error:>6.2%}"
        seen = outcome.verified[finger]
        line += f"  {seen.force_n:>7.3f}  {seen.told_n:>7.3f}  {seen.board_error:>6.2%}  {seen.float_error:>7.2%}"
        out.append(line)
    notes = [note for its in outcome.fits.values() for note in its.notes]
    notes += [
        f"finger {f}: {seen.board_error:.1%} off on the verification press (the paper's: {PAPER_ERROR:.2%}): was it at "
        "another place, or pressed in another way?"
        for f, seen in outcome.verified.items()
        if seen.board_error > PAPER_ERROR
    ]
    lags = [f"finger {f}: pressure lags the force by {lag} rows" for f, lag in outcome.lag_rows.items() if lag]
    return [*out, *(f"  {note}" for note in (*notes, *lags))]
