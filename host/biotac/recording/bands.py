"""Vibration energy of a recording's dynamic pressure: as the board sent it, or as it would have."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..core.bands import bands_of
from ..wire import messages_gen as wire
from ..wire.dtypes_gen import DTYPES
from ..wire.frames import BANDS_DTYPE, StructArray, bands_from_wire
from .stamps import unwrapped_us


def recorded_bands(pac: StructArray, messages: list[Any], begin_us: int) -> StructArray:
    """BANDS_DTYPE (n,): each finger's BANDS among ``messages`` or, if it has none, computed from its ``pac`` rows.

    Times of messages are unwrapped from ``begin_us`` on. Rows are sorted by finger, and in order within a finger.
    """
    bands = [message for message in messages if isinstance(message, wire.Bands)]
    parts = []
    for finger in sorted({m.finger for m in bands} | set(np.unique(pac["finger"]).tolist())):
        of_finger = [message for message in bands if message.finger == finger]
        parts.append(_of_messages(of_finger, begin_us) if of_finger else bands_of(pac[pac["finger"] == finger]))
    return np.concatenate(parts) if parts else np.empty(0, BANDS_DTYPE)


def _of_messages(bands: list[wire.Bands], begin_us: int) -> StructArray:
    sent = np.frombuffer(b"".join(message.pack() for message in bands), DTYPES[wire.Bands.ID])
    seq = np.unwrap(sent["seq"].astype(np.int64), period=2**16)
    return bands_from_wire(sent, seq, unwrapped_us(begin_us, sent["t_us"]))
