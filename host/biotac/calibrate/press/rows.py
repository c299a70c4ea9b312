"""The rows that the calibration uses, one per finger and round: pressure, rest, the board's force, the reference's."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...recording.pressure_check import usable
from ...wire import messages_gen as wire
from ...wire.frames import FORCE_LSB_PER_N, Q4_PER_COUNT, StructArray, to_units
from .force_source import Reference

#: ``pressure`` is PDC through the board's filter and ``rest`` the tare of the same frame, in counts, NaN where unknown.
#: ``board_n`` is the board's own force from them, ``force_n`` the reference's, NaN where unknown. ``touched`` means
#: contact or a fault, ``railed`` a PDC at an end of its range.
ROW_DTYPE = np.dtype(
    [
        *(("finger", "u1"), ("t_us", "<i8")),
        *((name, "<f8") for name in ("pressure", "rest", "board_n", "force_n")),
        *(("touched", "?"), ("railed", "?")),
    ]
)


def rows_of(messages: StructArray, t_us: NDArray[np.int64], reference: Reference | None = None) -> StructArray:
    """Rows (n,) from FRAME messages (n,) and their unwrapped times (n,), with the reference's force."""
    out = np.empty(len(messages), ROW_DTYPE)
    out["finger"], out["t_us"] = messages["finger"], t_us
    out["pressure"] = to_units(messages["pdc_filtered_q4"], Q4_PER_COUNT)
    out["rest"] = to_units(messages["pdc_tare_q4"], Q4_PER_COUNT)
    out["board_n"] = to_units(messages["pressure_force_100un"], FORCE_LSB_PER_N)
    out["force_n"] = np.nan if reference is None else reference.at(messages["finger"], t_us)
    out["touched"] = (messages["flags"] & (wire.FrameFlags.CONTACT | wire.FrameFlags.FAULT)) != 0
    out["railed"] = ~usable(messages["pdc"]) & (messages["pdc"] != wire.INVALID_COUNT)
    return out
