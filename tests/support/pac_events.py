"""Jolts and slips from dynamic pressure alone, by the board's own code (firmware/core/events)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from biotac.core.compiled import c_pointers, checked_words
from biotac.core.finger import EVENT_DTYPE
from biotac.wire.native import lib

_MOST_A_ROUND = 8


def pac_events(pac: Any) -> tuple[NDArray[np.void], NDArray[np.bool_]]:
    """EVENT_DTYPE (k,) of a finger that holds something throughout, and whether it slips at each round's end (n,).

    ``pac`` (n, 22) are as in pac_bands().
    """
    words = checked_words("pac", pac, None, 22)
    slips = np.zeros(len(words), np.uint8)
    events = np.zeros(_MOST_A_ROUND * len(words), EVENT_DTYPE)
    found = lib.bt_replay_pac(len(words), *c_pointers(words), True, *c_pointers(slips, events), len(events))
    return events[:found], slips.astype(bool)
