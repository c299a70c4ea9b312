"""Counts for the emulated sensor, and the known truth about them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..kernels.geometry import Floats
from ..wire import sensor_gen as _sensor
from ..wire.batches import ROUND_US
from .fault_gen import EmuFault
from .physics import SimFinger

Rows = npt.NDArray[np.int64]

CODES = tuple(fault for fault in EmuFault if fault)  # in place of a count; see enum emu_fault (protocol/fault.toml)
BLOCK = 10_000  # frames at a time, for memory
_SLOTS = len(_sensor.SLOTS)

MAX_SECONDS = 7200.0  # the wire's 32 bits of us wrap after 4295 s; 5 fingers for so long are 320 MB of counts


def _played(part: int) -> Any:
    """An attribute of Truth: ``part`` of the timeline at each frame."""
    return cached_property(lambda truth: truth._timeline[part][truth._rows])


class Truth:
    """A scenario's load, at the middle of each frame.

    ``contact`` bool (frames, fingers); ``poc_mm`` float64 (frames, fingers, 3), the point on the core
    surface, NaN without contact; ``force_n`` and ``torque_nmm`` float64 (frames, fingers, 3), on the
    finger, the torque about the origin: c x f + torsion n. Frame and origin are Lin's, figure 4.
    """

    def __init__(
        self, contact: npt.NDArray[np.bool_], poc_mm: Floats, force_n: Floats, torque_nmm: Floats, rows: Rows
    ) -> None:
        """Truth from the arrays of one timeline; ``rows`` (frames,) is each frame's index in that."""
        self._timeline = contact, poc_mm, force_n, torque_nmm
        self._rows = rows

    contact: npt.NDArray[np.bool_] = _played(0)
    poc_mm: Floats = _played(1)
    force_n: Floats = _played(2)
    torque_nmm: Floats = _played(3)


@dataclass(frozen=True)
class Source:
    """Counts to play, and the known truth about them.

    ``samples`` uint16 (frames, fingers, 44) in SLOTS order, 100 frames/s: counts 0..4095 or one of CODES. ``truth`` is
    None for recorded counts. ``tare_q4`` uint16 (fingers, 19), count * 16: a stored tare the board should be given, or
    None. ``truth_force_n`` float64 (frames, fingers, 3): the force a recording itself carries, in Lin's frame, or None.
    ``serials``: one of 16 characters a finger. ``emulated``: the sensor of each finger; () for a recording.
    ``skipped_frames``: incomplete frames of a recording that were omitted.
    """

    name: str
    samples: npt.NDArray[np.uint16]
    truth: Truth | None = None
    tare_q4: npt.NDArray[np.uint16] | None = None
    truth_force_n: npt.NDArray[np.float64] | None = None
    serials: tuple[str, ...] = ()
    emulated: tuple[SimFinger, ...] = ()
    skipped_frames: int = 0

    def applied_n(self, finger: npt.NDArray[np.uint8], since_us: npt.NDArray[np.int64]) -> Floats | None:
        """See Played.applied_n; the first row with a good word is round 0."""
        known = self.truth_force_n if self.truth is None else self.truth.force_n
        if known is None:
            return None
        first = next((k for k, row in enumerate(self.samples) if (row <= 4095).any()), 0)
        rows = first + np.rint(since_us / ROUND_US).astype(np.int64)
        inside = (rows >= 0) & (rows < len(known))
        return np.where(inside[:, None], known[np.clip(rows, 0, len(known) - 1), finger], np.nan)


def check_samples(source: Source) -> None:
    """Raise InputError when a source's samples have a wrong shape, type or value."""
    samples = source.samples
    if samples.ndim != 3 or samples.shape[2] != _SLOTS or samples.dtype != np.uint16:
        raise InputError(
            f"source {source.name}: samples are {samples.dtype} {samples.shape}: expected uint16 "
            f"(frames, fingers, {_SLOTS}); load it with load_source"
        )
    for first in range(0, len(samples), BLOCK):
        block = samples[first : first + BLOCK]
        wrong = (block > _sensor.FULL_SCALE_COUNT) & (block < min(CODES))
        if wrong.any():
            frame, finger, slot = np.argwhere(wrong)[0].tolist()
            raise InputError(
                f"source {source.name}: frame {first + frame}, finger {finger}, slot {slot} holds "
                f"{block[frame, finger, slot]}: expected a count 0..{_sensor.FULL_SCALE_COUNT} or a code from "
                f"{min(CODES):#06X}; load it with load_source"
            )
