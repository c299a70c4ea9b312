"""Jolts and slips from dynamic pressure alone, by the board's own code (firmware/core/events)."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from biotac.core.finger import EVENT_DTYPE
from biotac.kernels.compiled import checked_words
from biotac.wire import messages_gen as wire
from biotac.wire.native import ffi, lib


def pac_events(pac: Any) -> tuple[NDArray[np.void], NDArray[np.bool_]]:
    """EVENT_DTYPE (k,) of a finger that holds something throughout, and whether it slips at each round's end (n,).

    ``pac`` (n, 22) are as in pac_bands().
    """
    finger, message, packed = ffi.new("bt_finger *"), ffi.new("bt_msg_event *"), bytearray(EVENT_DTYPE.itemsize)
    lib.bt_finger_reset(finger, 0)
    finger.events.touched, finger.tare.state = 1, wire.TareState.CONTACT
    events, slips = [], []
    for k, words in enumerate(checked_words("pac", pac, None, 22).tolist()):
        finger.seq = k % 2**16
        for slot, before in enumerate(lib.bt_slot_pac):  # in those that are not due, nothing is found
            arrived = min(before + 1, len(words))  # as the words come
            finger.round.pac[0:arrived] = words[:arrived]
            found = lib.bt_finger_events(finger, slot, False)
            for kind in (kind for kind in range(found.bit_length()) if found >> kind & 1):
                t_us = (10_000 * k + slot * 1_000_000 // 4400) % 2**32
                lib.bt_finger_event(finger, kind, slot, t_us, message)
                lib.bt_msg_event_pack(message, ffi.from_buffer(packed))
                events.append(bytes(packed))
        slips.append(finger.events.slipping)
    return np.frombuffer(b"".join(events), EVENT_DTYPE), np.array(slips, bool)
