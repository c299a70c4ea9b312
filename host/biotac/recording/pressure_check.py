"""Checks the board's filtered pressure and the force from it in float64, frame by frame: Navarro 2015, Eq 1 and 3.

The force depends on its own frame alone, which holds filtered pressure and rest. The filter's state is all in the
previous frame's output, so each frame is checked by Eq 3 from the previous frame's published value. Without a previous
frame (at the start of a stream, after lost frames or heartbeats) the filtered pressure is accepted and counted in
``starts``; a wrong one there shows up in the next frame.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..core.finger import ROUND_US
from ..kernels.compiled import NN_PER_N, Settings
from ..wire import messages_gen as wire
from ..wire.frames import FORCE_LSB_PER_N, Q4_PER_COUNT, StructArray, to_units
from ..wire.native import lib

RAIL_COUNT: int = lib.BT_THRESHOLD_RAIL_COUNT
#: Half a step of the published force, N.
FORCE_BOUND_N = 0.5 / FORCE_LSB_PER_N
SLACK = 1e-9  # for rounding in float64: an error of exactly half a step is allowed
INNER_STEP = 1 / 256  # of the board's filter, counts

Findings = list[tuple[int, str]]  # wrong rows, and the fault


def filter_bound(alpha: float) -> float:
    """Largest rounding error, counts: half a published step, the filtered half step before it, half an inner step."""
    return 0.5 / Q4_PER_COUNT * (1.0 + (1.0 - alpha)) + 0.5 * INNER_STEP


def usable(pdc: NDArray[np.uint16]) -> NDArray[np.bool_]:
    """Mask of the values that are neither missing nor railed, by the board's rule."""
    return np.asarray((pdc > 0) & (pdc < RAIL_COUNT))


@dataclass
class PressureCheck:
    """Results over any number of frames, given in order of arrival. Maxima are over valid results."""

    force_n_max: float = 0.0
    filter_max: float = 0.0
    filter_bound: float = 0.0  # the largest bound applied to any frame, counts
    starts: int = 0  # frames without a previous frame to check the filter from
    _last: dict[int, StructArray] = field(default_factory=dict)

    def add(self, messages: StructArray, settings: Settings) -> Findings:
        """Check FRAME messages (n,) of fingers that share ``settings``."""
        found = self._forces(messages, settings)
        for finger in np.unique(messages["finger"]).tolist():
            at = np.flatnonzero(messages["finger"] == finger)
            found += self._filters(finger, messages[at], at, settings)
        return found

    def _forces(self, messages: StructArray, settings: Settings) -> Findings:
        gain_n = settings[wire.Setting.PRESSURE_GAIN_NN] / NN_PER_N or np.nan
        pressure = to_units(messages["pdc_filtered_q4"], Q4_PER_COUNT)
        rest = to_units(messages["pdc_tare_q4"], Q4_PER_COUNT)
        truth = (pressure - rest) * gain_n
        sent = to_units(messages["pressure_force_100un"], FORCE_LSB_PER_N)
        error = np.abs(sent - truth)
        self.force_n_max = max(self.force_n_max, float(np.nanmax(error, initial=0.0)))
        one_sided = np.isnan(sent) != np.isnan(truth)
        return _findings("force from pressure", "mN", 1e3, one_sided, error, FORCE_BOUND_N)

    def _filters(self, finger: int, rows: StructArray, at: NDArray[np.intp], settings: Settings) -> Findings:
        alpha = settings[wire.Setting.PRESSURE_FILTER_MILLI] / 1000
        # The first row without one before it follows itself, which no row does.
        before = np.concatenate([self._last.get(finger, rows[:1]), rows[:-1]])
        self._last[finger] = rows[-1:]
        follows = (rows["seq"] - before["seq"] == 1) & (rows["t_us"] - before["t_us"] < 1.5 * ROUND_US)
        good, good_before = usable(rows["pdc"]), usable(before["pdc"])
        sent = to_units(rows["pdc_filtered_q4"], Q4_PER_COUNT)
        sent_before = to_units(before["pdc_filtered_q4"], Q4_PER_COUNT)
        truth = np.where(good_before, alpha * rows["pdc"] + (1.0 - alpha) * sent_before, rows["pdc"])
        not_asked = np.isnan(sent) & ((rows["flags"] & wire.FrameFlags.NOT_ASKED) != 0)
        one_sided = (np.isnan(sent) == good) & ~not_asked
        checked = good & follows & ~np.isnan(sent) & ~np.isnan(truth)
        self.starts += int((good & ~np.isnan(sent) & ~checked).sum())
        error = np.where(checked, np.abs(sent - truth), 0.0)
        bound = filter_bound(alpha)
        if checked.any():
            self.filter_max = max(self.filter_max, float(error.max()))
            self.filter_bound = max(self.filter_bound, bound)
        found = _findings("filtered pressure", "counts", 1, one_sided, error, bound)
        return [(int(at[row]), finding) for row, finding in found]


def _findings(
    name: str, unit: str, scale: float, one_sided: NDArray[np.bool_], error: NDArray[np.float64], bound: float
) -> Findings:
    return [
        (int(k), f"{name} is valid on one side only")
        if one_sided[k]
        else (int(k), f"{name} off by {error[k] * scale:.4g} {unit}, bound {bound * scale:.4g} {unit}")
        for k in np.flatnonzero(one_sided | (error > bound + SLACK))
    ]
