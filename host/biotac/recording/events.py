"""EVENTs of a recording, a row each."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from ..wire.events import kind_name
from ..wire.frames import StructArray
from ..wire.messages_gen import INVALID_COUNT, Event
from .unix_time import unwrapped_us

#: An event: when it began (``at_s``, seconds since the recording's first row; ``onset_us``, device time) and was sent
#: (``t_us``); the name of the EventKind; NaN without a peak of vibration, 255 without a trust.
EVENT_DTYPE = np.dtype(
    {
        "names": ["finger", "kind", "at_s", "onset_us", "t_us", "peak_count", "trust"],
        "formats": ["u1", "U5", "f8", "i8", "i8", "f8", "u1"],
    }
)


def events_of(messages: Iterable[Any], begin_us: int) -> StructArray:
    """The EVENTs among a recording's ``messages`` as EVENT_DTYPE (n,), in order of arrival."""
    events = [message for message in messages if isinstance(message, Event)]
    sent_us = unwrapped_us(begin_us, [event.t_us for event in events])
    rows = []
    for event, t_us in zip(events, sent_us.tolist(), strict=True):
        onset_us = t_us - (event.t_us - event.onset_us) % 2**32
        peak = np.nan if event.peak_count == INVALID_COUNT else event.peak_count
        rows.append((event.finger, kind_name(event), (onset_us - begin_us) / 1e6, onset_us, t_us, peak, event.trust))
    return np.array(rows, EVENT_DTYPE)
