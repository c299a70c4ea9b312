"""A board's map over recorded counts in float64, in place of what the gains give."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...core.board_map import BoardMap
from ...core.geometry import Floats
from ...wire import map_gen as _map
from ...wire import messages_gen as wire
from ...wire.frames import StructArray, tare_to_q4
from . import board


def by_map(results: StructArray, its: BoardMap, counts: Any, tare: Any, pdc_above_rest: Any) -> StructArray:
    """``results`` of biotac.compute, MAPPED_RESULT_DTYPE, with what a map has in place of the gains'; the same array.

    Shapes as there; ``pdc_above_rest`` in counts, (n,), one number, or None: missing. Raises ValueError for
    a pressure of another shape.
    """
    rows = results.reshape(-1)
    raw = np.asarray(counts).reshape(len(rows), -1).astype(np.uint16)
    tare_q4 = tare_to_q4(np.broadcast_to(np.asarray(tare, dtype=np.float64), raw.shape))
    pressure = np.asarray(np.nan if pdc_above_rest is None else pdc_above_rest, dtype=np.float64)
    if pressure.shape not in ((), (len(rows),)):
        raise ValueError(f"pdc_above_rest has shape {pressure.shape}, expected ({len(rows)},) or one number")
    known = np.rint(16 * np.nan_to_num(np.broadcast_to(pressure, len(rows))))
    pdc_q4 = np.where(np.isnan(pressure), wire.INVALID_I32, known).astype(np.int32)
    wrench = board.exact(its, raw, tare_q4, pdc_q4)
    replace_gains(its, wrench, rows["poc_mm"], rows["force_n"], rows["torque_nmm"], rows["torsion_nmm"])
    return results


def replace_gains(
    its: BoardMap, wrench: Floats, poc_mm: Floats, force_n: Floats, torque_nmm: Floats, torsion_nmm: Floats
) -> None:
    """Put a map's ``wrench`` (n, axes), as of board.exact, into the gains' results: (n, 3) each, torsion (n,).

    Without torque of its own the map's force makes torque x, by the lever to ``poc_mm`` (n, 3), and the rest of the
    torque stays; without torsion there is none, NaN.
    """
    force_n[:] = wrench[:, :3]
    if its.axes > 3:
        torque_nmm[:] = wrench[:, 3:6]
    else:
        torque_nmm[:, 0] = poc_mm[:, 1] * wrench[:, 2] - poc_mm[:, 2] * wrench[:, 1]
    torsion_nmm[:] = wrench[:, 6] if its.axes == _map.AXES_TORSION else np.nan
