"""EVENTs from recorded words, found by the board's own code (firmware/core/events)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..wire import messages_gen as wire
from ..wire.dtypes_gen import DTYPES
from ..wire.frames import StructArray
from ..wire.native import ffi, lib
from .bands import pac_words

#: An EVENT message's fields (protocol/MESSAGES.md), as the board sends them.
EVENT_DTYPE = DTYPES[wire.Event.ID]
_MOST_A_ROUND = 8


def pac_events(pac: Any, *, held: bool = True) -> tuple[StructArray, NDArray[np.bool_]]:
    """Jolts and slips from dynamic pressure alone.

    ``pac`` (n, 22) are integers 0..4095, or 0xFFFF where no valid word came; each row is a round of 10 ms, and no
    rounds are missing. With ``held`` the finger holds something throughout; otherwise nothing touches it, its noise is
    learned and nothing slips. Returns EVENT_DTYPE (k,), whose times count from the first round, and bool (n,), whether
    it slips at the end of each round. Raises ValueError for another shape, type or range.
    """
    words = pac_words(pac)
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
