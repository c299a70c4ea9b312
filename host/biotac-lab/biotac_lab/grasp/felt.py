"""What a law is given to feel without a board: the plant's own forces, a round late, right or wrong by so much."""

from __future__ import annotations

import numpy as np

from biotac import Frame, FrameFlags

from .plant import Plant
from .trial import Sense

TOUCHED_N = 0.05
SHARES = {2: (1.0, 1.0), 3: (1.0, 0.5, 0.5)}  # by fingers: what each bears of its side's force


class TrueForce(Sense):
    """Forces ``off_n`` too high, and slides as a board reports them, at their onset; none if ``deaf``."""

    def __init__(self, fingers: int, off_n: float = 0.0, deaf: bool = False) -> None:
        self._shares, self._off_n, self._deaf, self._seq = SHARES[fingers], off_n, deaf, 0
        self._last, self._slid = (0.0, 0.0, False), False

    def feel(self, plant: Plant) -> tuple[list[Frame | None], bool]:
        """See Sense."""
        normal_n, shear_n, slides = self._last
        self._last = plant.normal_n, float(np.hypot(*plant.touch(0)[1:3])), plant.slip_mm_s > 0
        told, self._slid, self._seq = slides and not self._slid and not self._deaf, slides, self._seq + 1
        touched, none = normal_n > TOUCHED_N, np.full(3, np.nan)
        force_n = np.array([0.0, shear_n, max(normal_n + self._off_n, 0.0) if touched else 0.0])
        flags = FrameFlags.CONTACT if touched else FrameFlags(0)
        return [
            Frame(k, self._seq, 0, np.zeros(19, np.uint16), 0, 0, 0, none, force_n * share, none, flags)
            for k, share in enumerate(self._shares)
        ], told
