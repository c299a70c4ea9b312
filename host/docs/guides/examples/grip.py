"""Close two fingers on a thing, hold it no harder than it needs: ``Grip``, tried on simulated ones by python grip.py"""

import numpy as np

from biotac import EventKind, FrameFlags, Trust
from biotac.sim import SimFinger, Touch, world

ROUND_S, LAG_S, CLOSING_MM_S = 0.01, 0.03, 10.0  # the lag is from a command to the motion that a frame shows
RESERVE, FRICTION = 1.25, 0.6  # press that much harder than is needed; the friction that is assumed until a slip
RELEASE_N_PER_S, SMOOTH = 0.9, 0.3  # what slips is not let go by much until it is reported; jumps shake like slips
CALM = 6.0, 5.0, SMOOTH  # squeeze with so many N/s for each N that is missing, at most, and change it so smoothly
REFLEX, REFLEX_ROUNDS = (40.0, 40.0, 1.0), 8  # the same after a slip, and for how long
SLIPS_FROM, PENDING_ROUNDS = 22, 3  # the level of a slip, which a squeeze hardly has, and for how long it is awaited
LATE = 0.9  # of what is needed: pressed when a slip is felt
DOUBT, DOUBT_RESERVE = 0.45, 0.65  # of shear's half width; of what pressed, on top where shear says nothing
BLIND_ROUNDS, BLIND_SHARE = 3, 0.4  # who feels nothing for so long presses harder by that, as it may get heavier,
BLIND_MARGINS, BLIND_SLIPS = 4, 2  # by so many of its margins, and by that share again for each of so many slips


class Grip:
    """A controller of two sides that close on a thing, by the force that their fingers feel: call ``step`` each round.

    ``towards`` (n, 3) is where the thing presses each finger, in its axes, which a hand knows from where its fingers
    meet; ``shares`` (n,) what of its side's force each bears. It presses with ``least_n`` to ``most_n``.
    """

    def __init__(self, towards=((0, 0, 1), (0, 0, 1)), shares=(1.0, 1.0), least_n=0.8, most_n=12.0) -> None:
        self.towards, self.shares = [np.asarray(to, float) for to in towards], shares
        self.least_n, self.most_n, self.wanted_n = least_n, most_n, least_n
        self.stiffness = 0.8  # N/mm in front of the fingers, until it is felt
        self.slip_n, self.slip_shear_n, self.power = LATE, FRICTION, 1.0  # of the latest slip: see needed_n
        self.speed_mm_s, self.normal_n, self.shear_n, self.margin_n = CLOSING_MM_S, 0.0, 0.0, 0.0
        self.holds, self.settled, self.slips = False, 0, 0  # rounds near the wanted force; slips acted on
        self._blind_slips, self._blind_n = 0, 0.0  # while nothing is felt, and how much harder it pressed since
        self._round = self._blind = self._reflex_until = self._pending_until = self._way_mm = self._first_n = 0

    def step(self, frames, slipped: bool) -> float:
        """How fast the sides are to close until the next round, in mm/s; negative: open.

        ``frames`` has each finger's Frame of this round, None where none came; ``slipped``: the board reported a SLIP.
        """
        self._round, self._blind = self._round + 1, self._blind + 1
        sides = zip(frames, self.towards, self.shares, strict=True)
        known = [(f, to, w) for f, to, w in sides if f and f.trust >= Trust.INTERVAL and np.isfinite(f.force_n).all()]
        if self.holds and (not known or self._blind > 1):
            self._way_mm += self.speed_mm_s * ROUND_S  # also what it did blindly makes the force
        if not known:
            self.speed_mm_s = self._press_blindly(slipped) / self.stiffness if self.holds else 0.0
            return self.speed_mm_s
        if self._blind > 1:
            self.speed_mm_s = 0.0  # what it did blindly is no rate to go on from
        slipped = slipped or self._blind_slips > 0  # it may slip still
        self._blind, self._blind_slips, self._blind_n = 0, 0, 0.0
        if not self.holds and not all(f.flags & FrameFlags.CONTACT for f, *_ in known):
            most_n = max(f.force_n @ to / share for f, to, share in known)
            self.speed_mm_s = CLOSING_MM_S if most_n < self.most_n else 0.0
            return self.speed_mm_s
        normal_n, shear_n, margin_n, half_n = np.nan_to_num(np.mean([self._parts(*k) for k in known], 0)).tolist()
        self.margin_n += 0.1 * (margin_n - self.margin_n)
        self.normal_n = normal_n + self.margin_n
        self._first_n, self.holds = self._first_n if self.holds else self.normal_n, True
        self._way_mm += self.speed_mm_s * ROUND_S
        if self._way_mm > 0.3 and self.normal_n - self._first_n > 0.3:
            self.stiffness = min(max((self.normal_n - self._first_n) / self._way_mm, 0.2), 3.0)
        self.shear_n += SMOOTH * (shear_n - self.shear_n)
        self._pending_until = self._round + PENDING_ROUNDS if slipped else self._pending_until
        strong = any(SLIPS_FROM <= f.slip_level < 255 for f, *_ in known)
        if strong and self._reflex_until <= self._round < self._pending_until:
            self._learn_from_slip(shear_n, half_n)
        return self._squeeze()

    def _parts(self, frame, to, share):  # of its side: what presses, shear, what else may press, shear's half width
        normal_n = frame.force_n @ to
        margin_n = 0.0 if frame.trust == Trust.ACT else frame.normal_half_n / 2
        return np.array([normal_n, np.linalg.norm(frame.force_n - normal_n * to), margin_n, frame.shear_half_n]) / share

    def _press_blindly(self, slipped: bool) -> float:
        """How fast to press, in N/s, where nothing is felt; in many gaps, too, once from what was felt."""
        self._blind_slips = min(self._blind_slips + slipped, BLIND_SLIPS)
        pressed_n = min(self.normal_n, self.wanted_n)
        enough_n = pressed_n * (1 + BLIND_SHARE) ** (1 + self._blind_slips)
        enough_n += min(BLIND_MARGINS * self.margin_n, pressed_n)
        if self._blind < BLIND_ROUNDS or self.normal_n + self._blind_n >= min(enough_n, self.most_n):
            return 0.0
        rate_n_s = (REFLEX if self._blind_slips else CALM)[1]
        self._blind_n += rate_n_s * ROUND_S
        return rate_n_s

    def needed_n(self, shear_n: float) -> float:
        """What each side has to press with at this shear, by the latest slip; where shear says nothing, as then."""
        return self.slip_n / LATE * (shear_n / self.slip_shear_n) ** self.power

    def _learn_from_slip(self, shear_n: float, half_n: float) -> None:
        self.slip_n, self.slip_shear_n = max(self.normal_n, 0.05), max(shear_n, 0.02)
        self.power = 1 / (1 + (DOUBT * half_n / self.slip_shear_n) ** 2)
        self.least_n = max(self.least_n, (RESERVE + DOUBT_RESERVE * (1 - self.power)) * self.normal_n)
        self.slips, self._pending_until, self._reflex_until = self.slips + 1, 0, self._round + REFLEX_ROUNDS

    def _squeeze(self) -> float:
        self.wanted_n = wanted_n = min(max(self.least_n, RESERVE * self.needed_n(self.shear_n)), self.most_n)
        before_n_s = self.speed_mm_s * self.stiffness
        missing_n = wanted_n - self.normal_n - LAG_S * before_n_s
        self.settled = self.settled + 1 if abs(missing_n) < 0.15 * wanted_n else 0
        gain, most, smooth = REFLEX if self._round < self._reflex_until else CALM
        wanted_n_s = min(max(gain * missing_n * (abs(missing_n) > 0.05 * wanted_n), -RELEASE_N_PER_S), most)
        self.speed_mm_s = (before_n_s + smooth * (wanted_n_s - before_n_s)) / self.stiffness
        return self.speed_mm_s


if __name__ == "__main__":
    grip, closed_mm = Grip(), 0.0
    with world({"index": SimFinger(11), "thumb": SimFinger(12)}) as hand:
        for seconds, touch_n in (7.0, 0.0), (0.5, 1.0), (0.5, 0.0):  # once they have let go, their tares are sure
            hand.run(seconds, index=Touch(touch_n), thumb=Touch(touch_n))
        for k in range(300):  # between them a thing of 1 N/mm, whose weight comes in the third second
            closed_mm += grip.speed_mm_s * ROUND_S
            press_n, pull_n = max(closed_mm - 2.0, 0.0), max(k - 200, 0) / 200
            now = hand.step(index=Touch(press_n, (0.0, -pull_n)), thumb=Touch(press_n, (0.0, pull_n)))
            grip.step([now[name].frame for name in now], any(e.kind == EventKind.SLIP for e in now.events))
    print(f"holds {2 * pull_n:.1f} N of weight with {press_n:.1f} N, and feels {grip.normal_n:.1f} N")
