"""How often a source publishes: its period, messages that never came, and whether it stays so."""

from __future__ import annotations

from collections import deque

import numpy as np

from ...errors import PortError

ROUND_US = 10_000
# More between two messages, and the fingers fell silent meanwhile: the tare machine's measure of that (SPEC.md).
SILENCE_US = 90_000
LEAST_HZ = 50.0
# Steps within these times the median are of one message: the others span some that never came, if they are the fewer.
NEAR, NEAR_SHARE, NEAR_TIME = (0.5, 1.6), 0.6, 0.3
LATEST, LOOK_EVERY = 100, 10  # steps; their median shows a change
# within these times the median, for so many: a source that is only irregular, or loses much, still has its rate
STEADY, STEADY_SHARE = (0.8, 1.25), 0.75


class Rate:
    """``step_us`` from message to message, ``each``: how many make a round. Raises PortError below LEAST_HZ."""

    def __init__(self, port: str, stamps_ns: list[int]) -> None:
        steps_us = np.diff(stamps_ns) / 1e3
        steps_us = steps_us[steps_us > 0]
        self._median_us = float(np.median(steps_us)) if len(steps_us) else np.inf
        quick_us = steps_us[steps_us < SILENCE_US]
        used_us = quick_us if 2 * len(quick_us) > len(steps_us) else steps_us
        low_us, high_us = (factor * self._median_us for factor in NEAR)
        near_us = steps_us[(low_us <= steps_us) & (steps_us <= high_us)]
        # Of messages that come in bursts, most steps are short, too, but take next to no time.
        if len(near_us) >= NEAR_SHARE * len(steps_us) and near_us.sum() > NEAR_TIME * used_us.sum():
            used_us = near_us
        self.step_us = float(used_us.mean()) if len(used_us) else np.inf
        if self.step_us > 1e6 / LEAST_HZ:
            raise PortError(
                f"{port}: {len(stamps_ns)} messages at {1e6 / self.step_us:.0f} a second, expected at least "
                f"{LEAST_HZ:g}, as tare and contact count rounds; let a driver publish at 100 Hz"
            )
        self.each = max(1, round(ROUND_US / self.step_us))

    def missing(self, step_us: int) -> int:
        """How many messages never came within a step; a longer one is a pause, in which nobody published."""
        return max(0, round(step_us / self.step_us) - 1) if step_us <= SILENCE_US else 0

    def change(self) -> RateChange:
        """Whether the rate stays so, from here on."""
        return RateChange(self.step_us, self._median_us)


class RateChange:
    """The latest steps of a source with usual steps of ``usual_us``."""

    def __init__(self, *usual_us: float) -> None:
        self._usual_us = usual_us
        self._steps_us: deque[int] = deque(maxlen=LATEST)
        self._count = 0

    def since(self, step_us: int) -> tuple[float, float] | None:
        """Messages a second now, and how many s ago that began, if they are others than at first."""
        self._steps_us.append(step_us)
        self._count += 1
        if self._count < LATEST or self._count % LOOK_EVERY:
            return None
        now_us = float(np.median(self._steps_us))
        if any(NEAR[0] * usual_us <= now_us <= NEAR[1] * usual_us for usual_us in self._usual_us):
            return None
        steps = list(self._steps_us)
        others = [k for k, own in enumerate(steps) if not STEADY[0] * now_us <= own <= STEADY[1] * now_us]
        if len(others) > (1 - STEADY_SHARE) * LATEST:
            return None
        return 1e6 / now_us, sum(steps[others[-1] + 1 if others else 0 :]) / 1e6
