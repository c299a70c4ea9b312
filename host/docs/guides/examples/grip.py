"""Close two fingers on a thing, hold it no harder than it needs: ``Grip``, tried on simulated ones by python grip.py"""

import numpy as np

from biotac import EventKind, Trust
from biotac import FrameFlags as F
from biotac.sim import SimFinger, Touch, world

ROUND_S, CLOSING_MM_S = 0.01, 10.0
LAG_S = 0.03  # from a command to the motion that the next frame shows: the actuator's, and a round
RESERVE, FRICTION = 1.25, 0.6  # press that much harder than friction needs, which the first slip teaches
GAIN_PER_S, SQUEEZE_N_PER_S = 6.0, 5.0  # squeeze with so many N/s for each N that is missing, at most
REFLEX_PER_S, REFLEX_N_PER_S, REFLEX_ROUNDS = 40.0, 20.0, 8  # the same after a slip, and for how long
RELEASE_N_PER_S = 0.9  # a thing that begins to slip is not let go by much before that is reported
SMOOTH = 0.3  # of a change of rate, or of shear, made in each round: what jumps to and fro shakes like a slip
SLIPS_FROM, PENDING_ROUNDS = 22, 3  # the level of a slip, which a squeeze hardly has, and for how long it is awaited
LIKELY, FAINT_N = 0.8, 0.1  # of the friction that a slip taught: with less shear another is unlikely, if shear is felt
WIDE = F.ELECTRODE_OUT | F.ELECTRODE_MISSING | F.RAIL | F.ELECTRODE_ALONE | F.OUTSIDE
COARSE = F.TEMP | F.BASE_OLD


class Grip:
    """A controller of two sides that close on a thing, by the force that their fingers feel: call ``step`` each round.

    ``towards`` (n, 3) is where the thing presses each finger, in its axes, which a hand knows from where its fingers
    meet; ``shares`` (n,) what of its side's force each bears. It presses with ``least_n`` to ``most_n``.
    """

    def __init__(self, towards=((0, 0, 1), (0, 0, 1)), shares=(1.0, 1.0), least_n=0.8, most_n=12.0) -> None:
        self.towards, self.shares = [np.asarray(to, float) for to in towards], shares
        self.least_n, self.most_n, self.wanted_n = least_n, most_n, least_n
        self.friction, self.stiffness = FRICTION, 0.8  # N/mm in front of the fingers, until it is felt
        self.speed_mm_s, self.normal_n, self.shear_n = CLOSING_MM_S, 0.0, 0.0
        self.holds, self.settled, self.slips = False, 0, 0  # rounds near the wanted force; slips acted on
        self._round = self._reflex_until = self._pending_until = self._way_mm = self._first_n = 0

    def step(self, frames, slipped: bool) -> float:
        """How fast the sides are to close until the next round, in mm/s; negative: open.

        ``frames`` has each finger's Frame of this round, None where none came; ``slipped``: the board reported a SLIP.
        """
        self._round += 1
        felt = zip(frames, self.towards, self.shares, strict=True)
        felt = [(f, f.force_n / share, to) for f, to, share in felt if f is not None and f.trust >= Trust.INTERVAL]
        felt = [one for one in felt if np.isfinite(one[1]).all()]
        if not felt:
            self.speed_mm_s = 0.0  # nothing is known: stay where you are
            return 0.0
        normals = [float(force @ to) for _, force, to in felt]
        shears = [float(np.linalg.norm(force - n * to)) for n, (_, force, to) in zip(normals, felt, strict=True)]
        shear_n, flags = sum(shears) / len(shears), np.bitwise_or.reduce([int(f.flags) for f, *_ in felt])
        self.normal_n = sum(normals) / len(normals)
        if not self.holds:
            if not all(f.flags & F.CONTACT for f, *_ in felt):
                return self.speed_mm_s
            self.holds, self._first_n = True, self.normal_n
        self._way_mm += self.speed_mm_s * ROUND_S
        if self._way_mm > 0.3 and self.normal_n - self._first_n > 0.3:
            self.stiffness = min(max((self.normal_n - self._first_n) / self._way_mm, 0.2), 3.0)
        self.shear_n += SMOOTH * (shear_n - self.shear_n)
        self._pending_until = self._round + PENDING_ROUNDS if slipped else self._pending_until
        if self._reflex_until <= self._round < self._pending_until:
            ratio, strong = shear_n / max(self.normal_n, 0.05), any(SLIPS_FROM <= f.slip_level < 255 for f, *_ in felt)
            if strong and (not self.slips or shear_n < FAINT_N or ratio > LIKELY * self.friction):
                self._learn_from_slip(ratio)
        return self._squeeze(RESERVE * (1.2 if flags & WIDE else 1.0), bool(flags & COARSE))

    def _learn_from_slip(self, ratio: float) -> None:
        self.friction = max(0.9 * ratio, 0.03)  # of what is felt, which may be a fifth of the true shear
        self.slips, self._pending_until = self.slips + 1, 0
        self.least_n = min(max(self.least_n, RESERVE * self.normal_n), self.most_n)
        self._reflex_until = self._round + REFLEX_ROUNDS

    def _squeeze(self, reserve: float, coarse: bool) -> float:
        self.wanted_n = min(max(self.least_n, reserve * self.shear_n / self.friction), self.most_n)
        coming_n = self.speed_mm_s * self.stiffness * LAG_S
        missing_n, reflex = self.wanted_n - self.normal_n - coming_n, self._round < self._reflex_until
        self.settled = self.settled + 1 if abs(missing_n) < 0.15 * self.wanted_n else 0
        gain, most = (REFLEX_PER_S, REFLEX_N_PER_S) if reflex else (GAIN_PER_S, SQUEEZE_N_PER_S)
        near = (coarse and not reflex) or abs(missing_n) <= 0.05 * self.wanted_n
        wanted_n_s = 0.0 if near else min(max(gain * missing_n, -RELEASE_N_PER_S), most)
        before_n_s = self.speed_mm_s * self.stiffness
        self.speed_mm_s = (before_n_s + SMOOTH * (wanted_n_s - before_n_s)) / self.stiffness
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
