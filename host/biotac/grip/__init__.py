"""``Grip`` closes fingers on a thing and holds it no harder than necessary, by the force that the fingers feel.

    CLOSING -- all fingers touched --> HOLDING ------- slip -------> REFLEX
                                       |  ^  ^                       |  |
                                       |  |  '--- presses enough ----'  |
                      no usable force  |  |  usable force               |  no usable force
                                       v  |                             |
                                       FROZEN <-------------------------'
                                       |  ^
       three rounds without any frame  |  |  a frame, but no usable force
                                       v  |
                                       BLIND -- usable force --> HOLDING

A force is usable from trust INTERVAL on; that of one finger is enough. CLOSING moves at a constant speed, and stands
still without a usable force. HOLDING presses calmly, REFLEX as fast as the hand can. FROZEN stands still, and presses
harder only on a slip. BLIND presses harder once in any case: unseen, the load may grow.
"""

from typing import TYPE_CHECKING

from ..renamed import old_names
from .constants import PENDING_ROUNDS, SLIPS_FROM_COUNTS
from .law import Grip, GripState

__all__ = ["PENDING_ROUNDS", "SLIPS_FROM_COUNTS", "Grip", "GripState"]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__, {"State": "GripState"})
