"""What a simulated board is given before its time starts: its source's settings and stored tare."""

from __future__ import annotations

from .. import _wire as wire
from ..hand import Hand


def prepare(hand: Hand) -> Hand:
    """Send the source's settings and tare, if the link has a source; returns the hand."""
    source = getattr(hand.link, "source", None)
    if source is None:
        return hand
    try:
        for name, value in source.settings.items():
            hand.set_setting(wire.Setting[name.upper()], value)
        if source.tare_q4 is not None:
            for finger, tare_q4 in enumerate(source.tare_q4):
                hand.set_tare(finger, tare_q4 / 16.0)
    except BaseException:
        hand.close()
        raise
    return hand
