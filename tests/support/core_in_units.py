"""The compiled core and the float64 reference on counts and a tare in counts, with results in mm, N and N*mm."""

from typing import Any

import numpy as np

from biotac.kernels.compiled import Results, Settings, default_settings, on_board_q4, reference_q4
from biotac.wire.frames import FORCE_LSB_PER_N, MNMM_PER_NMM, UM_PER_MM, tare_to_q4, to_units


def on_board(counts: Any, tare: Any, settings: Settings | None = None) -> Results:
    """The board's integer kernels: counts (n, 19) or (19,), tare of that shape or (19,), rounded as the board does."""
    poc_um, force_100un, torque_mnmm, *_ = on_board_q4(*_rows(counts, tare), settings or default_settings())
    return Results(
        to_units(poc_um, UM_PER_MM), to_units(force_100un, FORCE_LSB_PER_N), to_units(torque_mnmm, MNMM_PER_NMM)
    )


def reference(counts: Any, tare: Any, settings: Settings | None = None) -> Results:
    """The results of firmware/reference for the same arguments."""
    return reference_q4(*_rows(counts, tare), settings or default_settings())


def _rows(counts: Any, tare: Any) -> tuple[np.ndarray, np.ndarray]:
    raw = np.atleast_2d(np.asarray(counts)).astype(np.uint16)
    return raw, tare_to_q4(np.broadcast_to(np.asarray(tare, dtype=np.float64), raw.shape))
