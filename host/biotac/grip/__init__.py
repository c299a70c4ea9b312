"""``Grip`` closes fingers on a thing and holds it no harder than necessary, by the force that the fingers feel.

    from             to       when
    CLOSING          HOLDING  all fingers are touched
    HOLDING          REFLEX   a slip
    REFLEX           HOLDING  it presses enough
    HOLDING, REFLEX  FROZEN   no finger has a force to act on; after three rounds without a frame BLIND
    FROZEN, BLIND    HOLDING  a force to act on

CLOSING moves at a constant speed, and stands still while no force may be acted on. HOLDING presses calmly, REFLEX
as fast as the hand can. FROZEN neither closes nor opens. BLIND presses harder, once: unseen, the load may grow.
"""

from typing import TYPE_CHECKING

from ..renamed import old_names
from .constants import PENDING_ROUNDS, SLIPS_FROM_COUNTS
from .law import Grip, GripState

__all__ = ["PENDING_ROUNDS", "SLIPS_FROM_COUNTS", "Grip", "GripState"]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__, {"State": "GripState"})
