"""Close fingers on a thing and hold it no harder than it needs, by the force that they feel: ``Grip``.

    CLOSING -- all fingers are touched --> HOLDING -- a slip ---------------> REFLEX
                                           |  ^  ^---- it presses enough --------|
       a frame without a force to act on,  |  |
       or three rounds without a frame     v  |  a force to act on
                                        FROZEN / BLIND

CLOSING at a constant speed, and still while no force may be acted on. HOLDING presses as the shear needs, calmly.
REFLEX does so as fast as the hand can, from a slip until it presses enough and nothing slides. FROZEN does not close or
open: the board says that there is nothing to act on. BLIND presses harder, once: the board is away, and things may get
heavier.
"""

from typing import TYPE_CHECKING

from ..renamed import old_names
from .constants import PENDING_ROUNDS, SLIPS_FROM_COUNTS
from .law import Grip, GripState

__all__ = ["PENDING_ROUNDS", "SLIPS_FROM_COUNTS", "Grip", "GripState"]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__, {"State": "GripState"})
