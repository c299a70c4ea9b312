"""Things to be held, and the fingers that hold them, in steps of 1 ms: quasi-static but for the thing's slide.

The stiffness of the skin, the actuators and the things are free choices, not measurements. A thing drops where it has
slid by ``DROPPED_MM``, and is crushed where its limit is exceeded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

G = 9.81
ROUND_S, STEPS = 0.01, 10
SKIN_N_PER_MM, SHEAR_N_PER_MM = 2.5, 3.0  # one finger's skin
CLOSED_MM = 2.0  # each finger touches there
LAG_S, MOST_MM_S = 0.02, 40.0  # of the actuators, unless the former is given
KINETIC = 0.85  # of the static friction, once it slides
DROPPED_MM, SLIP_MM_S = 15.0, 200.0  # the latter is the fastest that a simulated finger feels


@dataclass(frozen=True)
class Item:
    """``stiffness`` in N/mm; ``added_kg`` is put on it in the air, ``knock_n`` hits it, ``limit_n`` crushes it."""

    mass_kg: float
    friction: float
    stiffness: float
    added_kg: float
    knock_n: float
    limit_n: float

    @property
    def worst_n(self) -> float:
        """The least that each side has to press with at most, but for the knock."""
        return (self.mass_kg + self.added_kg) * G / (2 * self.friction)


def items(count: int, seed: int) -> list[Item]:
    """The first ``count`` of a seed's: 50 to 400 g, for a two-finger grip of at least 0.4 and less than 6 N."""
    rng, made = np.random.default_rng(seed), list[Item]()
    while len(made) < count:
        mass_kg, friction = math.exp(rng.uniform(math.log(0.05), math.log(0.4))), rng.uniform(0.35, 0.9)
        stiffness, added_kg = math.exp(rng.uniform(math.log(0.8), math.log(30))), mass_kg * rng.uniform(0.3, 0.8)
        item = Item(mass_kg, friction, stiffness, added_kg, rng.uniform(0.2, 0.5) * (mass_kg + added_kg) * G, 0.0)
        item = replace(item, limit_n=max(item.worst_n, 0.8) * rng.uniform(1.6, 4))
        if 0.4 < item.worst_n < 6:
            made.append(item)
    return made


class Plant:
    """A thing on a table between two sides that press alike, each with one finger or several.

    Public after each step: the mean ``normal_n`` of the sides; of the thing, ``slip_mm_s`` over the skin, ``slid_mm``
    altogether, ``in_air``, and ``most_n``, the largest press on it. ``extra_kg`` and ``hit_n`` are set from outside.
    """

    def __init__(self, item: Item, lag_s: float | None = None) -> None:
        self.item, self.extra_kg, self.hit_n, self.normal_n, self.most_n = item, 0.0, 0.0, 0.0, 0.0
        self._lag_s = LAG_S if lag_s is None else lag_s
        self.slip_mm_s, self.slid_mm, self.in_air = 0.0, 0.0, False
        self._closed_mm = self._speed_mm_s = self._hand_mm = self._slide_mm_s = self._shear_n = 0.0

    @property
    def need_n(self) -> float:
        """The least that each side has to press with now, in the air."""
        return ((self.item.mass_kg + self.extra_kg) * G + self.hit_n) / (2 * self.item.friction)

    def touch(self, side: int) -> tuple[float, float, float, float]:
        """A side's load on the finger: normal N, shear N by which the thing pulls down and across, torsion N mm."""
        return self.normal_n, self._shear_n, 0.0, 0.0

    def step(self, close_mm_s: float, up_mm_s: float) -> None:
        """A round of 10 ms: the fingers close at this speed, the hand goes up at that."""
        dt, mass_kg, self.slip_mm_s = ROUND_S / STEPS, self.item.mass_kg + self.extra_kg, 0.0
        pull_n, spring = mass_kg * G + self.hit_n, 2 * SHEAR_N_PER_MM
        stiffness = 1 / (2 / SKIN_N_PER_MM + 1 / self.item.stiffness)
        for _ in range(STEPS):
            self._actuate(dt, close_mm_s, up_mm_s)
            self.normal_n = max(stiffness * (self._closed_mm - CLOSED_MM), 0.0)
            self.most_n = max(self.most_n, self.normal_n)
            can_n = self._can_n()
            if self.in_air:
                slid_mm, held_n = self._bear(pull_n, mass_kg, dt)
                self.in_air = self._hand_mm - self.slid_mm - held_n / spring > 0
            else:  # the skin is stretched by the way from the table; the hand slides over a thing that it cannot lift
                self._slide_mm_s, stretched_n = 0.0, spring * (self._hand_mm - self.slid_mm)
                slid_mm = max(stretched_n - can_n, 0.0) / spring
                self.slid_mm += slid_mm
                held_n = max(min(stretched_n, can_n), -can_n)
                self.in_air = held_n >= pull_n
            self.slip_mm_s = max(self.slip_mm_s, min(slid_mm / dt, SLIP_MM_S))
        self._shear_n = held_n / 2

    def _can_n(self) -> float:
        return 2 * self.item.friction * self.normal_n * (KINETIC if self._slide_mm_s > 0 else 1)

    def _bear(self, pull_n: float, mass_kg: float, dt: float) -> tuple[float, float]:
        """How far it slides in dt, and the part of the pull that friction holds."""
        can_n = self._can_n()
        if pull_n > can_n or self._slide_mm_s > 0:
            self._slide_mm_s = max(self._slide_mm_s + (pull_n - can_n) / mass_kg * 1e3 * dt, 0.0)
        self.slid_mm += self._slide_mm_s * dt
        return self._slide_mm_s * dt, min(pull_n, can_n)

    def _actuate(self, dt: float, close_mm_s: float, up_mm_s: float) -> None:
        wanted = min(max(close_mm_s, -MOST_MM_S), MOST_MM_S)
        self._speed_mm_s += (wanted - self._speed_mm_s) * dt / self._lag_s
        self._closed_mm = max(self._closed_mm + self._speed_mm_s * dt, 0.0)
        if up_mm_s > 0 or self.in_air:  # a hand that goes down stops as the thing stands
            self._hand_mm += up_mm_s * dt
