"""One grasp: close, lift, a weight is put on, a knock, put down, let go; and the outcome."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..report import Facts
from .felt import TrueForce
from .plant import DROPPED_MM, ROUND_S

CLOSE_MM_S, OPEN_MM_S = 10.0, -20.0
LIFT_AT_LATEST, SETTLED = 250, 10  # rounds: when a grip is lifted
PUT_DOWN_S, OPEN_S, OPENING_ROUNDS = 4.0, 4.6, 25  # after the lift has begun, as FAULT_S: in the air, before the weight
FAULT_S = 1.8
ECHO_ROUNDS = 10  # a SLIP belongs to a slide until so long after it


class Slides:
    """Counts slides and SLIPs from the lift on, until it is let go.

    SLIPs ``reported`` are ``used`` by the law or ignored, and ``false`` where nothing slid; a slide without any is
    ``missed``. ``reaction_ms`` is from a slide's onset to the first SLIP that the law acts on.
    """

    def __init__(self) -> None:
        self.reported = self.used = self.false = self.slides = self.missed = 0
        self.reaction_ms: list[int] = []
        self._quiet, self._onset = ECHO_ROUNDS + 1, 0  # rounds without a slide
        self._reported = self._reacted = True

    def round(self, k: int, slides: bool, slip: bool, used: bool) -> None:
        """The next round, ``k``."""
        if slides and self._quiet > 0:
            self.missed += not self._reported
            self.slides, self._onset, self._reported, self._reacted = self.slides + 1, k, False, False
        self._quiet = 0 if slides else self._quiet + 1
        self.reported, self.used = self.reported + slip, self.used + used
        self.false += slip and self._quiet > ECHO_ROUNDS
        if self._quiet <= ECHO_ROUNDS:
            self._reported |= slip
            if used and not self._reacted:
                self._reacted = True
                self.reaction_ms.append(round((k - self._onset) * ROUND_S * 1e3))

    def facts(self) -> Facts:
        """All counts, at the end."""
        counts = {name: value for name, value in vars(self).items() if name[0] != "_"}
        return counts | {"missed": self.missed + (not self._reported)}


def grasp(plant: Any, law: Any, sense: TrueForce, fault: str = "", trace: list[Any] | None = None) -> Facts:
    """Run it: the outcome for the thing, with Slides' counts.

    ``hold_per_need`` is a median, ``off_n``, the felt force less the applied one, a mean, both in the air. ``law`` is a
    biotac.grip.Grip or one like it. ``trace`` gets (s, applied, felt, need, flags, SLIP) of each round.
    """
    slides, in_air, flagged, k, speed = Slides(), [], 0, 0, CLOSE_MM_S
    lifted, opened, held, item = math.inf, math.inf, False, plant.item
    while plant.slid_mm <= DROPPED_MM and plant.most_n <= item.limit_n and k <= opened + OPENING_ROUNDS:
        if k < lifted and (law.settled > SETTLED or k > LIFT_AT_LATEST):
            lifted = k
        since_s, up_mm_s = (k - lifted) * ROUND_S, 0.0
        if since_s >= 0:
            up_mm_s = 1.0 if since_s < 0.8 else 25.0 if since_s < 1.6 else 0.0 if since_s < PUT_DOWN_S else -40.0
            plant.extra_kg = item.added_kg * min(max((since_s - 2.2) / 0.4, 0.0), 1.0)
            plant.hit_n = item.knock_n if 3.2 <= since_s < 3.23 else 0.0
            opened = min(opened, k) if since_s >= OPEN_S else opened
            if fault and abs(since_s - FAULT_S) < ROUND_S / 2:
                sense.fault(fault)
        plant.step(speed if k < opened else OPEN_MM_S, up_mm_s)
        felt, before = sense.feel(plant), law.slips
        if felt is not None and k < opened:
            speed = law.step(*felt)
        if held != (law.holds and k < opened):
            held = not held
            sense.hold(held)
        frames, slip = ([f for f in felt[0] if f is not None], felt[1]) if felt else ([], False)
        flags = int(np.bitwise_or.reduce([int(f.flags) for f in frames])) if frames else 0
        felt_n = law.normal_n if frames and k < opened else math.nan
        if plant.in_air:
            in_air.append((plant.normal_n / plant.need_n, felt_n - plant.normal_n))
            flagged |= flags
        if lifted <= k < opened:
            slides.round(k, plant.slip_mm_s > 0, slip, law.slips > before)
        if trace is not None:
            trace.append((k * ROUND_S, plant.normal_n, felt_n, plant.need_n if plant.in_air else math.nan, flags, slip))
        k += 1
    if held:
        sense.hold(False)
    ratio, off_n = np.array(in_air).reshape(-1, 2).T
    off_n = off_n[np.isfinite(off_n)]
    return {
        "dropped": plant.slid_mm > DROPPED_MM, "crushed": plant.most_n > item.limit_n, "rounds": k, "flags": flagged,
        "most_n": round(plant.most_n, 3), "slid_mm": round(plant.slid_mm, 3),
        "hold_per_need": round(float(np.median(ratio)), 3) if len(ratio) else None,
        "off_n": round(float(off_n.mean()), 3) if len(off_n) else None, **slides.facts(),
    }  # fmt: skip
