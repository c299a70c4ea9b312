"""The rows that presses are found in, and the force to calibrate to: a magnitude in N for every frame (Eq 2).

There is no driver for a force plate here; anything that gives newtons at device times can be a ``ForceSource``.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...hand.hand import Hand
from ...kernels.compiled import ELECTRODES
from ...kernels.geometry import Floats
from ...recording.pressure_check import usable
from ...wire import messages_gen as wire
from ...wire.frames import FORCE_LSB_PER_N, Q4_PER_COUNT, StructArray, to_units

#: Gives the force on the pressed finger: from fingers (n,) and device times (n,) in us to the size (n,) in N, NaN where
#: unknown.
ForceSource = Callable[[NDArray[np.uint8], NDArray[np.int64]], Floats]

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
    out["force_n"] = np.nan if reference is None else reference(messages["finger"], t_us)
    out["touched"] = (messages["flags"] & (wire.FrameFlags.CONTACT | wire.FrameFlags.FAULT)) != 0
    out["railed"] = ~usable(messages["pdc"]) & (messages["pdc"] != wire.INVALID_COUNT)
    return out


def truth_of(hand: Hand) -> ForceSource | None:
    """The size of the force that a simulated board applies; None for a board behind which nothing knows it.

    It raises InputError where the board's source has no force.
    """
    if hand.link.source is None:
        return None

    def truth(finger: NDArray[np.uint8], t_us: NDArray[np.int64]) -> Floats:
        applied_n = hand.applied_n(finger, t_us)
        if applied_n is None and len(t_us):
            raise InputError(f"{hand.port} has no force; expected a scenario or a recording with one")
        return np.zeros(0) if applied_n is None else np.sqrt((applied_n**2).sum(axis=1))

    return truth
