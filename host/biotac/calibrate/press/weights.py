"""Known weights on the finger's pad, with the block that holds it level or tilted: forces that need no measurement.

The finger lies with the pad up. A weight that does not slide presses with its full force, vertically, so tilting the
block turns a known part of it into shear.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ...errors import InputError
from ..reference.scale import STANDARD_GRAVITY

MASSES_G = (200.0, 500.0)
TILTS_DEG = (15.0,)
MASS_G = (50.0, 2000.0)  # from the least that a finger feels to the most that it withstands
MAX_TILT_DEG = 30.0  # beyond, a weight slides even on rubber
LEVEL = "level"
#: The side that is lower, and the direction of the shear: x towards the tip, y towards E11's side (Lin's frame).
DOWN = {"the tip": (1.0, 0.0), "the base": (-1.0, 0.0), "E11's side": (0.0, 1.0), "E1's side": (0.0, -1.0)}


@dataclass(frozen=True)
class Load:
    """A mass on the pad; the block is tilted by ``tilt_deg`` with the side ``down``, a key of DOWN, lower, or LEVEL."""

    mass_g: float
    tilt_deg: float = 0.0
    down: str = LEVEL

    @property
    def size_n(self) -> float:
        return self.mass_g * 1e-3 * STANDARD_GRAVITY

    @property
    def toward(self) -> tuple[float, float, float]:
        """Unit vector of the force on the finger in Lin's frame."""
        along = math.sin(math.radians(self.tilt_deg))
        x, y = DOWN.get(self.down, (0.0, 0.0))
        return x * along, y * along, math.cos(math.radians(self.tilt_deg))

    def __str__(self) -> str:
        tilt = LEVEL if self.down == LEVEL else f"tilted by {self.tilt_deg:g} deg, {self.down} down"
        return f"{self.mass_g:g} g on the pad, the block {tilt}"


def plan(masses_g: Sequence[float], tilts_deg: Sequence[float]) -> tuple[Load, ...]:
    """Every mass on the level block, then at every tilt to every side. Raises InputError for values out of range."""
    low, high = MASS_G
    if not masses_g or not all(low <= mass <= high for mass in masses_g):
        raise InputError(f"masses of {_list(masses_g)} g: expected {low:g} to {high:g} g each; weigh them")
    if not all(0.0 < tilt <= MAX_TILT_DEG for tilt in tilts_deg):
        raise InputError(
            f"tilts of {_list(tilts_deg)} deg: expected above 0 and at most {MAX_TILT_DEG:g}, where a weight stays "
            "put; the level block is always included"
        )
    blocks = [(0.0, LEVEL), *((tilt, down) for tilt in tilts_deg for down in DOWN)]
    return tuple(Load(mass, tilt, down) for tilt, down in blocks for mass in masses_g)


def _list(values: Sequence[float]) -> str:
    return ", ".join(f"{value:g}" for value in values) or "none"
