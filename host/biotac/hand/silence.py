"""Fingers that fell silent: a display of last values must hear that there is no newer one."""

from __future__ import annotations

import time

import numpy as np

from ..wire.batches import ROUND_US, Batch
from ..wire.frames import StructArray, invalid_frames
from ..wire.messages_gen import FrameFlags, Trust

SILENT_S = 0.1
LOOK_S = SILENT_S / 2  #: for Hand.batches, so that silence is noticed where nothing comes

_NOTHING = invalid_frames(1)
_NOTHING["flags"], _NOTHING["trust"] = int(FrameFlags.FAULT | FrameFlags.POC_INVALID), int(Trust.NONE)


class Silence:
    """Reports once each finger that had frames and has had none for 0.1 s.

    By the device time of the other fingers, so that a slow program changes nothing; by this computer's where no finger
    has any.
    """

    def __init__(self) -> None:
        self._heard_us: dict[int, int] = {}  # of fingers that are not silent
        self._newest_us = 0
        self._came_s = time.monotonic()

    def rows(self, batch: Batch) -> StructArray:
        """FRAME_DTYPE (n,) for those that fell silent by now: all invalid, at the first round that is missing."""
        if len(batch.t_us):
            self._heard_us |= zip(batch.wire["finger"].tolist(), batch.t_us.tolist(), strict=True)
            self._newest_us, self._came_s = int(batch.t_us[-1]), time.monotonic()
        is_dead = time.monotonic() - self._came_s > SILENT_S
        # The time of a board that was reset is earlier.
        silent = [f for f, at_us in self._heard_us.items() if is_dead or abs(self._newest_us - at_us) > SILENT_S * 1e6]
        rows: StructArray = np.repeat(_NOTHING, len(silent))
        rows["finger"], rows["t_us"] = silent, [self._heard_us.pop(finger) + ROUND_US for finger in silent]
        return rows
