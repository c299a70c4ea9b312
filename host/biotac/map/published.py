"""What a board publishes of a finger's own map, in float64.

A map of the population map's blocks, as presses of a finger give it, extrapolates beyond these presses as that one
does, so boards judge it as that one, and mix its force. See SPEC.md, Population map.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ..kernels.geometry import Floats
from ..wire import messages_gen as wire
from ..wire.frames import StructArray, tare_to_q4
from .board_map import BoardMap
from .columns import tared
from .float64 import Unrounded, exact, replace_gains
from .margin import published_parts
from .population import Likeness, board_force_100un, likeness


def published(
    board_map: BoardMap,
    counts: npt.NDArray[np.uint16],
    tare_q4: npt.NDArray[np.uint16],
    pdc_q4: npt.NDArray[np.int32],
    wanted: Unrounded | None = None,
) -> tuple[Floats, Likeness | None]:
    """exact(), mixed as a board does where it judges the map, and then how the map was found."""
    wrench = exact(board_map, counts, tare_q4, pdc_q4, wanted)
    if not board_map.is_population:
        return wrench, None
    judged = likeness(tared(counts, tare_q4).e, board_force_100un(counts, tare_q4, board_map))
    return judged.mixed(wrench), judged


def by_map(results: StructArray, board_map: BoardMap, counts: Any, tare: Any, pdc_above_rest: Any) -> StructArray:
    """Replace in ``results`` of biotac.compute, MAPPED_RESULT_DTYPE, what the map has; returns the same array.

    Arguments have that function's shapes. ``pdc_above_rest``, in counts, is (n,), one number, or None: missing. Raises
    ValueError for a pressure of another shape.
    """
    rows = results.reshape(-1)
    raw = np.asarray(counts).reshape(len(rows), -1).astype(np.uint16)
    tare_q4 = tare_to_q4(np.broadcast_to(np.asarray(tare, dtype=np.float64), raw.shape))
    pressure = np.asarray(np.nan if pdc_above_rest is None else pdc_above_rest, dtype=np.float64)
    if pressure.shape not in ((), (len(rows),)):
        raise ValueError(f"pdc_above_rest has shape {pressure.shape}, expected ({len(rows)},) or one number")
    known = np.rint(16 * np.nan_to_num(np.broadcast_to(pressure, len(rows))))
    pdc_q4 = np.where(np.isnan(pressure), wire.INVALID_I32, known).astype(np.int32)
    wrench, judged = published(board_map, raw, tare_q4, pdc_q4)
    replace_gains(board_map, wrench, rows["poc_mm"], rows["force_n"], rows["torque_nmm"], rows["torsion_nmm"])
    parts = published_parts(rows["force_n"], rows["poc_mm"])
    half = board_map.margin.half_n(parts) + (0.0 if judged is None else judged.guess_n)
    half[np.isnan(rows["normal_half_n"])] = np.nan  # a count is missing
    rows["normal_n"], rows["shear_n"] = parts.T
    rows["normal_half_n"], rows["shear_half_n"] = half.T
    return results
