"""``Grip`` closes fingers on a thing and holds it no harder than necessary, by the force that the fingers feel.

    from             to       when
    CLOSING          HOLDING  all fingers are touched
    HOLDING          REFLEX   a slip
    REFLEX           HOLDING  it presses enough
    HOLDING, REFLEX  FROZEN   no finger has a force to act on
    FROZEN           BLIND    three rounds without a frame
    FROZEN, BLIND    HOLDING  a force to act on

CLOSING moves at a constant speed, and stands still while no force may be acted on. HOLDING presses as the shear needs,
calmly. REFLEX presses as fast as the hand can, from a slip until the press is enough and nothing slides. FROZEN neither
closes nor opens: the board reports no force to act on. BLIND presses harder, once: unseen, the load may grow.
"""

from typing import TYPE_CHECKING

from ..renamed import old_names
from .constants import PENDING_ROUNDS, SLIPS_FROM_COUNTS
from .law import Grip, GripState

__all__ = ["PENDING_ROUNDS", "SLIPS_FROM_COUNTS", "Grip", "GripState"]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__, {"State": "GripState"})
