"""The rows that presses are found in, and the force to calibrate to: a magnitude in N for every frame (Eq 2).

There is no driver for a force plate here; anything that gives newtons at device times can be a ``ForceSource``.
"""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ...core.compiled import ELECTRODES
from ...core.geometry import Floats
from ...errors import InputError, RecordingError
from ...hand.hand import Hand
from ...recording.pressure_check import usable
from ...wire import messages_gen as wire
from ...wire.frames import FORCE_LSB_PER_N, Q4_PER_COUNT, StructArray, to_units
from ..reference.csv_file import columns, open_table

LAG_ROWS = 100
MAX_LAG_ROWS = 20  # 0.2 s: more is not a transport delay but another clock; a contact held for 0.5 s allows this much
MIN_CORRELATION = 0.9
MAX_FORCE_N = 200.0  # more than a finger withstands; values in millinewtons and grams exceed it


class ForceSource(Protocol):
    """What knows the force on the finger that is pressed."""

    def at(self, finger: NDArray[np.uint8], t_us: NDArray[np.int64]) -> Floats:
        """Magnitude (n,) in N at device times (n,), NaN where it is not known."""


#: ``pressure`` is PDC through the board's filter and ``rest`` the tare of the same frame, in counts, NaN where unknown.
#: ``board_n`` is the board's own force from them, ``force_n`` the reference's, NaN where unknown. ``counts`` are the
#: electrodes' and ``tare`` theirs, NaN where unknown. ``touched`` means contact or a fault, ``railed`` a PDC at an end
#: of its range.
ROW_DTYPE = np.dtype(
    [
        *(("finger", "u1"), ("t_us", "<i8")),
        *((name, "<f8") for name in ("pressure", "rest", "board_n", "force_n")),
        *(("counts", "<u2", (ELECTRODES,)), ("tare", "<f8", (ELECTRODES,))),
        *(("touched", "?"), ("railed", "?")),
    ]
)


def rows_of(messages: StructArray, t_us: NDArray[np.int64], reference: ForceSource | None = None) -> StructArray:
    """Rows (n,) from FRAME messages (n,) and their unwrapped times (n,), with the reference's force."""
    out = np.empty(len(messages), ROW_DTYPE)
    out["finger"], out["t_us"] = messages["finger"], t_us
    out["pressure"] = to_units(messages["pdc_filtered_q4"], Q4_PER_COUNT)
    out["rest"] = to_units(messages["pdc_tare_q4"], Q4_PER_COUNT)
    out["board_n"] = to_units(messages["pressure_force_100un"], FORCE_LSB_PER_N)
    out["counts"], out["tare"] = messages["counts"], to_units(messages["tare_q4"], Q4_PER_COUNT)
    out["force_n"] = np.nan if reference is None else reference.at(messages["finger"], t_us)
    out["touched"] = (messages["flags"] & (wire.FrameFlags.CONTACT | wire.FrameFlags.FAULT)) != 0
    out["railed"] = ~usable(messages["pdc"]) & (messages["pdc"] != wire.INVALID_COUNT)
    return out


class Truth:
    """The size of the force that the simulated board of ``hand`` applies. Raises InputError if its source has none."""

    def __init__(self, hand: Hand) -> None:
        self._hand = hand

    def at(self, finger: NDArray[np.uint8], t_us: NDArray[np.int64]) -> Floats:
        applied_n = self._hand.applied_n(finger, t_us)
        if applied_n is None and len(t_us):
            raise InputError(f"{self._hand.port} has no force; expected a scenario or a recording with one")
        return np.zeros(0) if applied_n is None else np.sqrt((applied_n**2).sum(axis=1))


class Series:
    """Forces over device time, linearly interpolated; NaN before the first and after the last.

    ``t_s`` (n,) is in seconds of the board's time, ``force_n`` (n,) in N; ``name`` is for messages. Raises InputError
    for fewer than two rows, NaN, times that do not increase, and forces above MAX_FORCE_N.
    """

    def __init__(self, name: str, t_s: Floats, force_n: Floats) -> None:
        bad = ~np.isfinite(t_s) | ~np.isfinite(force_n)
        if len(t_s) < 2 or bad.any():
            seen = f"{len(t_s)} rows" if len(t_s) < 2 else f"{int(bad.sum())} of {len(t_s)} rows with NaN"
            raise InputError(f"{name} has {seen}; expected at least two rows, and a number in each")
        if (np.diff(t_s) <= 0).any():
            raise InputError(
                f"{name}: time does not increase in row {int(np.argmax(np.diff(t_s) <= 0)) + 2}; sort the rows"
            )
        if np.abs(force_n).max() > MAX_FORCE_N:
            raise InputError(
                f"{name} has forces up to {np.abs(force_n).max():.4g}, expected newtons, at most {MAX_FORCE_N:g}; "
                "convert them"
            )
        self.name = name
        self._t_s, self._force_n = t_s, force_n

    def at(self, finger: NDArray[np.uint8], t_us: NDArray[np.int64]) -> Floats:
        """See ForceSource.at; the force is the same for all fingers, as they share one plate."""
        return np.interp(t_us / 1e6, self._t_s, self._force_n, left=np.nan, right=np.nan)


def check_alignment(where: str, above_rest: Floats, force_n: Floats) -> int:
    """The number of rows by which one finger's pressure lags the force, both (n,); rows with NaN are left out.

    Raises InputError when they do not match.
    """
    lag, correlation = 0, -1.0
    for rows in range(-LAG_ROWS, LAG_ROWS + 1):
        a = above_rest[max(rows, 0) : len(above_rest) + min(rows, 0)]
        b = force_n[max(-rows, 0) : len(force_n) + min(-rows, 0)]
        both = np.isfinite(a) & np.isfinite(b)
        if both.sum() < 2 or a[both].std() == 0 or b[both].std() == 0:
            continue
        found = float(np.corrcoef(a[both], b[both])[0, 1])
        if found > correlation:
            lag, correlation = rows, found
    if correlation < MIN_CORRELATION or abs(lag) > MAX_LAG_ROWS:
        raise InputError(
            f"{where}: force and pressure are not aligned: they agree best with pressure {lag} rows after the force, "
            f"correlation {correlation:.2f}; expected at most {MAX_LAG_ROWS} rows, at least {MIN_CORRELATION:g}; is it "
            "this recording's force, in the board's own time (t_us of `biotac export`)?"
        )
    return lag


def load_csv(path: Path) -> Series:
    """The forces in a CSV file with a header: ``t_s`` (seconds of the board's time), and ``force_n`` or the three axes.

    The axes are ``fx_n``, ``fy_n``, ``fz_n``, or named as for `calibrate wrench`, ``Fx_N`` or ``Fx [N]``. Other columns
    are ignored. Raises InputError that says what is wrong with the file.
    """
    _, head, read = open_table(path)
    size = {"t_s", "force_n"} <= set(head)
    try:
        indices = [head.index("t_s"), head.index("force_n")] if size else columns(path, head, torque=False)[0]
    except RecordingError as error:
        raise InputError(
            f"{path} has columns {', '.join(head) or 'none'}; expected t_s and force_n, or t_s, fx_n, fy_n and "
            f"fz_n, in seconds and newtons, or a wrench ({error})"
        ) from None
    values = read(indices)
    return Series(str(path), values[:, 0], np.linalg.norm(values[:, 1:], axis=-1))
