"""A board's published force with a finger's own map, in float64.

A map of the population map's blocks, as presses of a finger give it, extrapolates beyond these presses as the
population map does, so boards treat it alike and mix its force. With any other map, the lesson decides. See SPEC.md,
Wrench maps and Population map.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from ..kernels.geometry import Floats
from ..wire import messages_gen as wire
from ..wire.frames import FORCE_LSB_PER_N, StructArray, tare_to_q4
from .board_map import BoardMap
from .float64 import Unrounded, exact, replace_gains
from .lesson import ALL, LessonMatch
from .margin import published_parts
from .population import Likeness, likeness_of, on_board


class Verdict(Protocol):
    """A board's verdict on a map's force in n frames."""

    @property
    def flags(self) -> npt.NDArray[np.int64]:
        """POPULATION and OUTSIDE (n,)."""

    def bound(self, off_n: Floats) -> Floats:
        """Of the board's error (n, axes), where the map by itself is off by at most ``off_n`` (n, axes)."""

    def half_n(self, parts_n: Floats) -> Floats:
        """Added to the half widths (n, 2) of normal and shear ``parts_n`` (n, 2) for the map's margin."""


@dataclass(frozen=True)
class Untaught:
    """By a map without a lesson."""

    rows: int

    @property
    def flags(self) -> npt.NDArray[np.int64]:
        return np.full(self.rows, wire.FrameFlags.OUTSIDE, np.int64)

    def bound(self, off_n: Floats) -> Floats:
        return off_n

    def half_n(self, parts_n: Floats) -> Floats:
        return np.zeros_like(parts_n)


@dataclass(frozen=True)
class Taught:
    """By a map's lesson: the force is the map's, or the ``default`` map's where a touch is unlike the lesson."""

    match: LessonMatch
    default: Likeness
    frames: tuple[npt.NDArray[np.uint16], npt.NDArray[np.uint16], npt.NDArray[np.int32]]

    @property
    def flags(self) -> npt.NDArray[np.int64]:
        unlike = self.default.flags | wire.FrameFlags.POPULATION
        return np.where(self.match.share < ALL, unlike, 0)

    def mixed(self, wrench: Floats) -> Floats:
        """A map's ``wrench`` (n, axes), with the force mixed."""
        otherwise_n = self.default.mixed(exact(on_board(), *self.frames))
        return np.column_stack([self.match.mixed(wrench[:, :3], otherwise_n), wrench[:, 3:]])

    def bound(self, off_n: Floats) -> Floats:
        from .bound import error_bound  # here: it is for checks alone

        part = (self.match.share / ALL)[:, None]
        default_n = self.default.bound(error_bound(on_board(), None, *self.frames))
        of_default = (1 - part) * (default_n * self.match.lesson.scale_q8 / ALL + 2.0 / FORCE_LSB_PER_N)
        mixed = part * off_n[:, :3] + of_default + 0.5 / FORCE_LSB_PER_N
        return np.column_stack([np.where(part < 1, mixed, off_n[:, :3]), off_n[:, 3:]])

    def half_n(self, parts_n: Floats) -> Floats:
        return self.match.half_n(parts_n, self.default.guess_n)


def published(
    board_map: BoardMap,
    counts: npt.NDArray[np.uint16],
    tare_q4: npt.NDArray[np.uint16],
    pdc_q4: npt.NDArray[np.int32],
    wanted: Unrounded | None = None,
) -> tuple[Floats, Verdict]:
    """exact(), mixed as a board does, and the verdict."""
    wrench = exact(board_map, counts, tare_q4, pdc_q4, wanted)
    if board_map.is_population:
        likeness = likeness_of(counts, tare_q4, board_map)
        return likeness.mixed(wrench), likeness
    if board_map.lesson is None:
        return wrench, Untaught(len(wrench))
    frames = counts, tare_q4, pdc_q4
    taught = Taught(board_map.lesson.match(board_map.seen(*frames)), likeness_of(counts, tare_q4), frames)
    return taught.mixed(wrench), taught


def by_map(results: StructArray, board_map: BoardMap, counts: Any, tare: Any, pdc_above_rest: Any) -> StructArray:
    """Replace in ``results`` of biotac.compute, MAPPED_RESULT_DTYPE, the map's axes; returns the same array.

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
    wrench, likeness = published(board_map, raw, tare_q4, pdc_q4)
    replace_gains(board_map, wrench, rows["poc_mm"], rows["force_n"], rows["torque_nmm"], rows["torsion_nmm"])
    parts = published_parts(rows["force_n"], rows["poc_mm"])
    half = board_map.margin.half_n(parts) + likeness.half_n(parts)
    half[np.isnan(rows["normal_half_n"])] = np.nan  # a count is missing
    rows["normal_n"], rows["shear_n"] = parts.T
    rows["normal_half_n"], rows["shear_half_n"] = half.T
    return results
