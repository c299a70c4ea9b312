"""The same as plant.Plant by MuJoCo: a box between two pads on springs of skin, lifted, loaded, knocked from the side.

A knock turns the box as well, so that the pads feel torsion. MuJoCo's friction creeps: motion slower than CREEP_MM_S
counts as held.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from biotac import InputError

from .plant import CLOSED_MM, ROUND_S, SHEAR_N_PER_MM, SKIN_N_PER_MM, SLIP_MM_S, G, Item, Plant

try:
    import mujoco
except ImportError as error:
    raise InputError("--plant mujoco needs MuJoCo: pip install 'biotac-lab[mujoco]'") from error

STEPS, CREEP_MM_S = 20, 1.0
HALF_MM, AIR_MM = 30.0, 0.05
MODEL = Path(__file__).with_suffix(".xml")


class MujocoPlant(Plant):
    """See Plant."""

    def __init__(self, item: Item, lag_s: float | None = None) -> None:
        super().__init__(item, lag_s)
        self._spring = 1e3 / (1 / SKIN_N_PER_MM + 1 / (2 * item.stiffness)), 1e3 * SHEAR_N_PER_MM
        text = MODEL.read_text(encoding="utf-8").format(
            dt=ROUND_S / STEPS, mass=item.mass_kg, off=(HALF_MM + CLOSED_MM + 2.0) / 1e3, normal=self._spring[0],
            shear=self._spring[1], friction=item.friction,
        )  # fmt: skip
        self._model = mujoco.MjModel.from_xml_string(text)
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)
        self._pads = [self._model.geom(f"pad{name}").id for name in "LR"]
        self._springs = [self._model.joint(f"normal{name}").qposadr[0] for name in "LR"]
        self._body = self._model.body("thing").id
        self._apart = self._relative()

    @property
    def need_n(self) -> float:
        """See Plant; the knock is from the side."""
        weight_n = (self.item.mass_kg + self.extra_kg) * G
        return float(np.hypot(weight_n, self.hit_n)) / (2 * self.item.friction)

    def touch(self, side: int) -> tuple[float, float, float, float]:
        """See Plant."""
        normal, up, across = self._data.qpos[self._springs[side] :][:3]
        force, torsion = np.zeros(6), 0.0
        for k, contact in enumerate(self._data.contact):
            if self._pads[side] in (contact.geom1, contact.geom2):
                mujoco.mj_contactForce(self._model, self._data, k, force)
                torsion += force[3] * 1e3
        return max(-normal * self._spring[0], 0.0), -up * self._spring[1], across * self._spring[1], torsion

    def step(self, close_mm_s: float, up_mm_s: float) -> None:
        """See Plant."""
        for _ in range(STEPS):
            self._actuate(ROUND_S / STEPS, close_mm_s, up_mm_s)
            self._data.ctrl[:] = self._hand_mm / 1e3, self._closed_mm / 1e3, self._closed_mm / 1e3
            self._data.xfrc_applied[self._body, 1:3] = self.hit_n, -self.extra_kg * G
            mujoco.mj_step(self._model, self._data)
            self.normal_n = -float(self._data.qpos[self._springs].mean()) * self._spring[0]
            self.most_n = max(self.most_n, self.normal_n)
        before, self._apart = self._apart, self._relative()
        speed = float(np.hypot(*(self._apart - before))) / ROUND_S
        self.slip_mm_s = min(speed, SLIP_MM_S) if speed > CREEP_MM_S else 0.0
        self.slid_mm += self.slip_mm_s * ROUND_S
        self.in_air = bool(self._data.xpos[self._body][2] * 1e3 - HALF_MM > AIR_MM)

    def _relative(self) -> Any:
        """Where the thing is between the pads, along their faces, mm."""
        return (self._data.xpos[self._body] - self._data.geom_xpos[self._pads].mean(axis=0))[1:] * 1e3
