"""The same as plant.Plant, of a hand that is slower and swings: each thing has a separate actuator behind it.

The weight comes by the clock, all of it in WEIGHT_S from when the hand begins to rise, however the skin yields; then
the thing swings. The contact damps. Put down, the weight goes as fast as the hand meets the table.
"""

from __future__ import annotations

import math

import numpy as np

from .plant import CLOSED_MM, ROUND_S, SKIN_N_PER_MM, SLIP_MM_S, STEPS, G, Item, Plant

LAGS_S = 0.012, 0.03  # a thing's actuator has one between them
WEIGHT_S, LANDING_S = 1.2, 0.15
SWING, SWINGS_HZ, SWINGING_S = 0.1, 1.5, 1.0  # of the weight
DAMPING_S = 0.004  # N s/mm for each N/mm


class LaggingPlant(Plant):
    """See Plant."""

    def __init__(self, item: Item, lag_s: float | None = None) -> None:
        drawn_s = float(np.random.default_rng(round(item.mass_kg * 1e9)).uniform(*LAGS_S))
        super().__init__(item, drawn_s if lag_s is None else lag_s)
        self._lifted_s = self._landed_s = 0.0

    @property
    def need_n(self) -> float:
        """See Plant."""
        return self._pull_n() / (2 * self.item.friction)

    def _pull_n(self) -> float:
        weight_n, swung_s = (self.item.mass_kg + self.extra_kg) * G, self._lifted_s - WEIGHT_S
        swing = SWING * math.sin(2 * math.pi * SWINGS_HZ * swung_s) if 0 < swung_s < SWINGING_S else 0.0
        borne = min(self._lifted_s / WEIGHT_S, 1.0) * max(1.0 - self._landed_s / LANDING_S, 0.0)
        return weight_n * (borne + swing) + self.hit_n

    def step(self, close_mm_s: float, up_mm_s: float) -> None:
        """See Plant."""
        dt, self.slip_mm_s = ROUND_S / STEPS, 0.0
        stiffness = 1 / (2 / SKIN_N_PER_MM + 1 / self.item.stiffness)
        for _ in range(STEPS):
            self._actuate(dt, close_mm_s, up_mm_s)
            self._lifted_s += dt if up_mm_s > 0 or self._lifted_s else 0.0
            self._landed_s += dt if up_mm_s < 0 else 0.0
            way_mm = self._closed_mm - CLOSED_MM
            pressed_n = stiffness * (way_mm + DAMPING_S * self._speed_mm_s) if way_mm > 0 else 0.0
            self.normal_n = max(pressed_n, 0.0)
            self.most_n = max(self.most_n, self.normal_n)
            slid_mm, held_n = self._bear(self._pull_n(), self.item.mass_kg + self.extra_kg, dt)
            self.slip_mm_s = max(self.slip_mm_s, min(slid_mm / dt, SLIP_MM_S))
        self.in_air = self._lifted_s >= WEIGHT_S and self._landed_s < LANDING_S
        self._shear_n = held_n / 2
