"""One finger's script: linear pieces between poses, evaluated at any time."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..kernels.geometry import Floats
from .physics import REST_CELSIUS, States


@dataclass(frozen=True)
class Pose:
    """The load on a finger at one instant.

    ``x_mm``, ``y_mm`` place the contact on the ventral surface; ``shear_x_n`` and ``shear_y_n`` are
    tangential, towards the tip and towards E11's side; ``torsion_nmm`` is about the outward normal;
    ``tip_mm`` is the width of the flat that presses; ``slip_mm_s`` is how fast it slides over the skin.
    ``force_n`` = 0: nothing touches.
    """

    x_mm: float = 0.0
    y_mm: float = 0.0
    force_n: float = 0.0
    shear_x_n: float = 0.0
    shear_y_n: float = 0.0
    torsion_nmm: float = 0.0
    tip_mm: float = 0.0
    celsius: float = REST_CELSIUS
    slip_mm_s: float = 0.0

    def released(self) -> Pose:
        """The same place and temperature, without load."""
        return replace(self, force_n=0.0, shear_x_n=0.0, shear_y_n=0.0, torsion_nmm=0.0)


def _numbers(pose: Pose) -> tuple[float, ...]:
    return tuple(vars(pose).values())  # astuple() copies each


@dataclass
class Track:
    """Pieces in time order; ``pose`` is where the last one ends."""

    pose: Pose = field(default_factory=Pose)
    seconds: float = 0.0
    moving_s: float = 0.0  #: part of ``seconds`` with a changing load, where each frame must be computed
    _pieces: list[tuple[Any, ...]] = field(default_factory=list)  # start and length in s, first and last pose

    def ramp(self, seconds: float, end: Pose, start: Pose | None = None) -> None:
        """Go linearly to ``end``; with ``start``, jump there first (a jump without load has no effect)."""
        begin = start or self.pose
        if replace(begin, celsius=end.celsius, slip_mm_s=end.slip_mm_s) != end:
            self.moving_s += seconds
        self._pieces.append((self.seconds, seconds, _numbers(begin), _numbers(end)))
        self.pose = end
        self.seconds += seconds

    def states(self, times_s: Floats) -> States:
        """States at times (n,) of 0..seconds; later times have the last pose."""
        starts, lengths, begin, end = (np.array(column) for column in zip(*self._pieces, strict=True))
        piece = np.maximum(np.searchsorted(starts, times_s, side="right") - 1, 0)
        share = np.clip((times_s - starts[piece]) / lengths[piece], 0.0, 1.0)[:, None]
        return States.of_poses(begin[piece] * (1.0 - share) + end[piece] * share)
