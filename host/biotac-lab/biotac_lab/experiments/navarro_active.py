"""Navarro et al. 2015, the active part: an emulated hand presses each finger on a plate, driven by the procedure.

The hand is in the loop (biotac.sim.world): biotac.calibrate.press.drive says which finger is to go where, joints need
time to get there, the plate gives way like a spring, and the board's results of each round decide the next one.
The paper's joint angles are 18, 20 and 22 degrees and 0 to let go; the fourth touch is not printed, here 21.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from biotac.calibrate.press import CALIBRATION_FORCES_N, VERIFICATION_FORCES_N, PressureFit, Verification, drive
from biotac.sim import Profile, SimFinger, SimTouch, World, world

TOUCHES_DEG = (18.0, 20.0, 22.0, 21.0)
TOUCHES_N = (*CALIBRATION_FORCES_N, *VERIFICATION_FORCES_N)
PLATE_DEG, N_PER_DEG = 15.0, 0.7  # where a finger meets the plate, and how stiff both are
DEG_PER_ROUND = 0.4
REST_S = 2.0


@dataclass(frozen=True)
class Active:
    """One finger that pressed by itself."""

    finger: str
    fit: PressureFit
    verified: Verification


class PlateHand:
    """An emulated hand before a force plate: the joints follow commands at DEG_PER_ROUND."""

    def __init__(self, w: World, fingers: Sequence[str]) -> None:
        self._world = w
        self._deg = dict.fromkeys(fingers, 0.0)
        self._wanted = dict.fromkeys(fingers, 0.0)
        self.moves: list[tuple[str, float | None]] = []

    def to_deg(self, finger: str, deg: float | None) -> None:
        """A callback of a user with a hand that moves by joint angles."""
        self.moves.append((finger, deg))
        self._wanted[finger] = 0.0 if deg is None else deg

    def to_n(self, finger: str, force_n: float | None) -> None:
        """A callback of a user with a hand that moves by newtons."""
        self.to_deg(finger, None if force_n is None else PLATE_DEG + force_n / N_PER_DEG)

    def forces_n(self) -> dict[str, float]:
        """Each finger's force."""
        return {name: max(0.0, (deg - PLATE_DEG) * N_PER_DEG) for name, deg in self._deg.items()}

    def plate_n(self) -> float:
        """The plate's reading."""
        return sum(self.forces_n().values())

    def step(self) -> Any:
        """Let a round of 10 ms pass; the board's frames and events of it, as hand.next_round gives them."""
        for name, wanted in self._wanted.items():
            self._deg[name] += min(max(wanted - self._deg[name], -DEG_PER_ROUND), DEG_PER_ROUND)
        return self._world.step(**{name: SimTouch(normal_n=n) for name, n in self.forces_n().items() if n > 0.0})


def calibrate(seed: int, fingers: Sequence[str], profile: Profile = "new", *, newtons: bool = False) -> list[Active]:
    """Calibrate and verify a hand of emulated ``fingers`` that moves by angles, or by newtons."""
    with world({name: SimFinger(seed + k, profile) for k, name in enumerate(fingers)}) as w:
        w.run(REST_S)
        hand = PlateHand(w, fingers)
        move, touches = (hand.to_n, TOUCHES_N) if newtons else (hand.to_deg, TOUCHES_DEG)
        found = drive(w.hand, move, hand.plate_n, touches, next_round=hand.step)
    return [Active(name, own.fit, own.verified) for name, own in found.items()]
