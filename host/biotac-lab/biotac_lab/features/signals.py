"""The input of every feature: electrode counts above the tare, and places on the skin laid flat."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from biotac import InputError
from biotac.core import geometry as surface
from biotac.kernels.geometry import Floats
from biotac.kernels.unroll import unroll
from biotac.wire import messages as wire
from biotac.wire import sensor as _sensor

ELECTRODES = len(_sensor.ELECTRODE_NAMES)


def signals(rows: npt.NDArray[Any]) -> Floats:
    """Counts above the tare (n, 19) float64, compression < 0; NaN where an electrode's count or tare is missing.

    ``rows`` are those of ``biotac.load`` or of a live hand, with ``counts`` and ``tare``, or an array (n, 19) of counts
    above the tare, which is returned as float64. Raises InputError for anything else.
    """
    rows = np.atleast_1d(rows)
    if rows.dtype.names is None:
        if rows.ndim != 2 or rows.shape[1] != ELECTRODES or rows.dtype.kind not in "fi":
            raise InputError(
                f"rows are {rows.dtype} {rows.shape}: expected frames from biotac.load, or counts above the tare "
                f"(n, {ELECTRODES})"
            )
        return rows.astype(np.float64)
    check_fields(rows, "counts", "tare")
    counts = rows["counts"]
    return np.where(counts == wire.INVALID_COUNT, np.nan, counts - rows["tare"].astype(np.float64))


def check_fields(rows: npt.NDArray[Any], *names: str) -> None:
    """Raises InputError unless the rows have these fields."""
    missing = [name for name in names if name not in (rows.dtype.names or ())]
    if missing:
        raise InputError(f"rows have no {' and no '.join(missing)}: expected frames; load those fields too")


def skin(points_mm: Floats) -> Floats:
    """Points on the core (n, 3) in mm as (d, r) in mm, (n, 2): figure 3 of Wettels and Loeb 2011.

    d runs along the finger from the proximal end of the pattern, x = -16 mm, to the tip. r is the arc from the ventral
    line, positive on E11's side (the paper's left is negative). On the cap they are like latitude and longitude on a
    globe with the pole at the tip.
    """
    across, along = unroll(surface.project(points_mm))
    return np.column_stack([along - surface.PROXIMAL_END_MM, across])


ELECTRODE_DR_MM = skin(surface.ELECTRODE_MM)
