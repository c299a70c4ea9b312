"""The law: how fast to close until the next round, from the frames of this one."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..wire.frames import Frame
from ..wire.messages_gen import FrameFlags, Trust
from . import constants as c


class Side(NamedTuple):
    """A finger whose force is known; ``load_n`` is the shear of the load that it bears."""

    frame: Frame
    to: NDArray[Any]
    share: float
    load_n: NDArray[Any]


class GripState(Enum):
    """Where a grip is: biotac.grip draws how it goes from one to the next."""

    CLOSING, HOLDING, REFLEX, FROZEN, BLIND = range(5)


class Grip:
    """A controller of two sides that close on a thing, by the force that their fingers feel: call ``step`` each round.

    ``towards`` (n, 3) is where the thing presses each finger, in the finger's axes; a hand knows it from where the
    fingers meet. ``shares`` (n,) is each finger's part of the force on one side. The grip presses with ``least_n`` to
    ``most_n``.
    """

    def __init__(
        self,
        towards: Sequence[ArrayLike] = ((0, 0, 1), (0, 0, 1)),
        shares: Sequence[float] = (1.0, 1.0),
        least_n: float = 0.8,
        most_n: float = 12.0,
    ) -> None:
        self.towards, self.shares = [np.asarray(to, float) for to in towards], shares
        self.least_n, self.most_n, self.wanted_n = least_n, most_n, least_n
        self.state, self.holds = GripState.CLOSING, False
        self.stiffness = c.STIFFNESS_N_PER_MM  # in front of the fingers
        self.slip_n, self.slip_shear_n, self.power = 1.0, c.FRICTION, 1.0  # of the latest slip: see needed_n
        self.speed_mm_s, self.normal_n, self.shear_n, self.margin_n = c.CLOSING_MM_S, 0.0, 0.0, 0.0
        self.settled = self.slips = 0  # rounds near the wanted force; slips that changed friction
        self._moves_mm_s, self._way_mm, self._first_n = c.CLOSING_MM_S, 0.0, 0.0  # the actuators: commanded, and done
        self._loads = [np.zeros(3) for _ in self.towards]
        self._round = self._pending_until = self._event_until = 0
        self._unfelt = self._away = self._unfelt_slips = 0  # rounds without force, without frames; slips meanwhile
        self._slides, self._unfelt_n = False, 0.0  # how much harder it pressed meanwhile

    def step(self, frames: Sequence[Frame | None], slipped: bool) -> float:
        """How fast the sides are to close until the next round, in mm/s; negative: open.

        ``frames`` has each finger's Frame of this round, None where none came; ``slipped``: the board reported a SLIP.
        """
        known = [
            Side(frame, to, share, load_n)
            for frame, to, share, load_n in zip(frames, self.towards, self.shares, self._loads, strict=True)
            if frame and frame.trust >= Trust.INTERVAL and np.isfinite(frame.force_n).all()
        ]
        unfelt = any(frame and frame.flags & FrameFlags.LEAP_PENDING for frame in frames)
        if unfelt and all(side.frame.force_n @ side.to / side.share < c.FELT_N for side in known):
            known = []  # a side does not feel what its pressure does, and these feel nothing either
        self._round += 1
        self._moves_mm_s += (self.speed_mm_s - self._moves_mm_s) * c.ROUND_S / c.LAG_S
        self._way_mm += self._moves_mm_s * c.ROUND_S if self.holds else 0.0
        if not known:
            self._away = self._away + 1 if all(f is None for f in frames) else 0
            self.speed_mm_s = self._press_unfelt(slipped) / self.stiffness if self.holds else 0.0
            return self.speed_mm_s
        if self._unfelt:
            self.speed_mm_s, slipped = 0.0, slipped or self._unfelt_slips > 0  # it may slip still
            self._unfelt = self._away = self._unfelt_slips = 0
            self.state, self._unfelt_n = GripState.HOLDING if self.holds else GripState.CLOSING, 0.0
        if not self.holds and not all(side.frame.flags & FrameFlags.CONTACT for side in known):
            most_n = max(side.frame.force_n @ side.to / side.share for side in known)
            self.speed_mm_s = c.CLOSING_MM_S if most_n < self.most_n else 0.0
            return self.speed_mm_s
        self._feel(known, slipped)
        return self._squeeze()

    def _feel(self, known: list[Side], slipped: bool) -> None:
        parts = np.nan_to_num([self._parts(*side) for side in known])
        normal_n, shear_n, margin_n, half_n = parts[:, :4].mean(0).tolist()
        borne, load = parts[:, 4:].sum(0).tolist()
        self.margin_n += c.MARGIN_SHARE * (margin_n - self.margin_n)
        self.normal_n = normal_n + self.margin_n
        if not self.holds:
            self.holds, self.state, self._first_n = True, GripState.HOLDING, self.normal_n
        if self._way_mm > c.FELT_MM and (more_n := self.normal_n - self._first_n) > c.FELT_N:
            self.stiffness = min(max(more_n / self._way_mm, c.LEAST_N_PER_MM), c.MOST_N_PER_MM)
        # A push against the load is the table's, and needs no press.
        share = (c.REFLEX if self.state is GripState.REFLEX else c.CALM)[2]
        self.shear_n += share * ((shear_n if borne >= 0 else 0.0) - self.shear_n)
        self._pending_until = self._round + c.PENDING_ROUNDS if slipped else self._pending_until
        strong = any(c.SLIPS_FROM_COUNTS <= side.frame.slip_level < 255 for side in known)
        told, new = strong and self._round < self._pending_until, self._round >= self._event_until
        if told and borne >= c.RELIEVED_SHARE * load:
            if new:
                self._learn_from_slip(shear_n, half_n)
            self.state = GripState.REFLEX
        self._slides = told or (strong and not new)
        if self._slides:
            self._event_until = self._round + c.EVENT_ROUNDS

    def _parts(self, frame: Frame, to: NDArray[Any], share: float, load_n: NDArray[Any]) -> list[float]:
        """One side's press, shear, half width of the press, half width of shear, shear along the load, and the load."""
        normal_n = frame.force_n @ to
        shear_n = frame.force_n - normal_n * to
        margin_n = 0.0 if frame.trust == Trust.ACT else c.INTERVAL_SHARE * frame.normal_half_n
        of_side = [part / share for part in (normal_n, np.linalg.norm(shear_n), margin_n, frame.shear_half_n)]
        load = [shear_n @ load_n, load_n @ load_n]
        load_n += c.LOAD_SHARE * (shear_n - load_n)
        return of_side + load

    def _press_unfelt(self, slipped: bool) -> float:
        """How fast to press, in N/s, without a force: 0, except after slips, and once while the board is away."""
        self._unfelt, away = self._unfelt + 1, self._away >= c.BLIND_ROUNDS
        self.state = GripState.BLIND if away else GripState.FROZEN
        self._unfelt_slips = min(self._unfelt_slips + slipped, c.BLIND_SLIPS)
        pressed_n = min(self.normal_n, self.wanted_n)
        enough_n = pressed_n * (1 + c.BLIND_SHARE) ** (away + self._unfelt_slips)
        enough_n += min(c.BLIND_MARGINS * self.margin_n, pressed_n) if away else 0.0
        if self._unfelt < c.BLIND_ROUNDS or self.normal_n + self._unfelt_n >= min(enough_n, self.most_n):
            return 0.0
        rate_n_s = c.REFLEX_N_PER_S if self._unfelt_slips else c.CALM_N_PER_S
        self._unfelt_n += rate_n_s * c.ROUND_S
        return rate_n_s

    def needed_n(self, shear_n: float) -> float:
        """The press that each side needs at this shear, by the latest slip; the former press if shear is unknown."""
        return float(self.slip_n * (shear_n / self.slip_shear_n) ** self.power)

    def _learn_from_slip(self, shear_n: float, half_n: float) -> None:
        self.slip_n, self.slip_shear_n = max(self.normal_n, 0.05), max(shear_n, 0.02)
        self.power = 1 / (1 + (c.DOUBT * half_n / self.slip_shear_n) ** 2)
        self.least_n = max(self.least_n, (c.RESERVE + c.DOUBT_RESERVE) * (1 - self.power) * self.normal_n)
        self.slips += 1

    def _squeeze(self) -> float:
        self.wanted_n = wanted_n = min(max(self.least_n, c.RESERVE * self.needed_n(self.shear_n)), self.most_n)
        before_n_s = self.speed_mm_s * self.stiffness
        missing_n = wanted_n - self.normal_n - c.LAG_S * self._moves_mm_s * self.stiffness  # the rest comes yet
        self.settled = self.settled + 1 if abs(missing_n) < c.SETTLED_SHARE * wanted_n else 0
        gain, most, share = c.REFLEX if self.state is GripState.REFLEX else c.CALM
        if missing_n <= c.NEAR_SHARE * wanted_n and not self._slides:
            self.state = GripState.HOLDING  # from the next round on: the reflex ends at once, and does not ebb away
        wanted_n_s = min(max(gain * missing_n * (abs(missing_n) > c.NEAR_SHARE * wanted_n), -c.RELEASE_N_PER_S), most)
        self.speed_mm_s = (before_n_s + share * (wanted_n_s - before_n_s)) / self.stiffness
        return self.speed_mm_s
