"""EVENTs of recorded words, by the board's own code (firmware/core/events)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..wire import messages_gen as wire
from ..wire import sensor_gen as sensor
from ..wire.dtypes_gen import DTYPES
from ..wire.frames import StructArray
from ..wire.native import ffi, lib

#: An EVENT message's fields (protocol/MESSAGES.md), as the board sends them.
EVENT_DTYPE = DTYPES[wire.Event.ID]
_MOST_A_ROUND = 8
_PAC = sensor.SLOTS.count("PAC")


def pac_events(pac: Any, *, held: bool = True) -> tuple[StructArray, NDArray[np.bool_]]:
    """Jolts and slips of dynamic pressure alone.

    ``pac`` (n, 22) are integers 0..4095, a round of 10 ms each and without a gap, 0xFFFF where no good word came. The
    finger is ``held`` throughout, or else nothing touches it: then its noise is learned and nothing slips. Returns
    EVENT_DTYPE (k,), whose times count from the first round, and bool (n,): it slips at the end of the round.
    Raises ValueError for another shape, type or range.
    """
    words = np.asarray(pac)
    if words.ndim != 2 or words.shape[1] != _PAC or words.dtype.kind not in "iu":
        raise ValueError(f"pac is {words.dtype} of shape {words.shape}, expected integers of (n, {_PAC})")
    if not np.all(((words >= 0) & (words <= sensor.FULL_SCALE_COUNT)) | (words == wire.INVALID_COUNT)):
        raise ValueError(
            f"pac holds {words.min()} to {words.max()}, expected 0 to {sensor.FULL_SCALE_COUNT}, or 0xFFFF"
        )
    words = np.ascontiguousarray(words, np.uint16)
    slips = np.zeros(len(words), np.uint8)
    events = np.zeros(_MOST_A_ROUND * len(words), EVENT_DTYPE)
    told = lib.bt_replay_pac(
        len(words),
        ffi.from_buffer("uint16_t[]", words),
        int(held),
        ffi.from_buffer("uint8_t[]", slips),
        ffi.from_buffer("uint8_t[]", events),
        len(events),
    )
    return events[:told], slips.astype(bool)
