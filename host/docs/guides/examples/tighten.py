"""A grip that tightens before it slips: python tighten.py, against a simulated finger and thing.

A finger holds a thing against a wall with 2 N while its weight comes upon it. What the finger feels goes through the
board's own code; a Bayes filter, trained on grasps that were let slip, says how near the grip is to giving.
"""

from dataclasses import dataclass, field

import numpy as np

import biotac
from biotac.core.finger import to_frames
from biotac.core.geometry import ELECTRODE_MM
from biotac.features import grip
from biotac.sim.gains import fit_gains
from biotac.sim.physics import Finger, States
from biotac.sim.sampling import sample
from biotac.wire.slots import ELECTRODE_SLOT, PAC_SLOT, PDC_SLOT, TDC_SLOT

ROUND_S = 0.01
BLOCK = 5  # rounds from one decision to the next
GRASP_S = 5.0
CLOSED_S, LIFTED_S = 1.0, 2.0  # when it presses, when the weight begins to come
FRICTION = 0.6
AT_MM = ELECTRODE_MM[16]  # E17, in the middle of the pad
HELD_N, MOST_N = 2.0, 8.0
TIGHTEN_N_PER_S = 3.0  # a quicker squeeze sounds like a slip
RESERVE = 0.4  # of what friction can hold: a felt ratio may be a fifth too low
LEARN_FROM = round((CLOSED_S + 0.5) / ROUND_S)
LOST_MM = 15.0  # slid: it is out of the grip


@dataclass
class Thing:
    """``mass_kg`` between finger and wall; its weight comes in ``lift_s``."""

    mass_kg: float
    lift_s: float
    slid_mm: float = 0.0
    speed_mm_s: float = 0.0
    rounds: list[tuple[float, float, float]] = field(default_factory=list)  # normal N, tangential N, mm/s

    def go_on(self, press_n: float) -> None:
        """A round of 10 ms in which it is pressed so much: Coulomb's friction."""
        t_s = len(self.rounds) * ROUND_S
        weight_n = 9.81 * self.mass_kg * min(max((t_s - LIFTED_S) / self.lift_s, 0.0), 1.0)
        spare_n = FRICTION * press_n - weight_n
        if spare_n < 0 or self.speed_mm_s > 0:
            self.speed_mm_s = max(self.speed_mm_s - 1e3 * spare_n / self.mass_kg * ROUND_S, 0.0)
        self.slid_mm += self.speed_mm_s * ROUND_S
        self.rounds.append((press_n, min(weight_n, FRICTION * press_n), self.speed_mm_s))

    def states(self) -> np.ndarray:
        """GripState of each round, which only a simulation knows."""
        normal, tangential, speed = np.array(self.rounds).T
        near = np.where(tangential > 0.8 * FRICTION * normal, grip.GripState.INCIPIENT, grip.GripState.STABLE)
        return np.where(speed > 0, grip.GripState.SLIPPING, near)


class Felt:
    """What a board with one finger, calibrated for such loads, says of it."""

    def __init__(self, seed: int) -> None:
        self._skin, self._fed = Finger(seed), 0
        loads = pressed(np.repeat([1.0, 2.0, 4.0], 3), np.tile([0.0, 0.2, 0.4], 3) * np.repeat([1.0, 2.0, 4.0], 3))
        signal = self._skin.counts(loads) - self._skin.rest_counts(loads.warm_c)
        gains = fit_gains(signal, *loads.wrench())
        self._board = biotac.Finger({biotac.Setting[name.upper()]: nn for name, nn in gains.items()})

    def latest(self, thing: Thing) -> np.ndarray:
        """grip.observations (n, 2) of the rounds since the last call."""
        states = pressed(*np.array([*thing.rounds, thing.rounds[-1]]).T)
        words = sample(self._skin, states)[self._fed :]  # a longer run begins as a shorter one
        self._fed += len(words)
        pac = words[:, PAC_SLOT]
        rows = self._board.feed(words[:, ELECTRODE_SLOT], words[:, PDC_SLOT], tdc=words[:, TDC_SLOT], pac=pac)
        frames = to_frames(rows)
        frames["poc_mm"] = AT_MM  # it is known where the wall is: a point that is felt moves with what pulls
        return grip.observations(frames, pac)


def pressed(normal_n: np.ndarray, tangential_n: np.ndarray, speed_mm_s: np.ndarray | None = None) -> States:
    """A flat of 6 mm on the pad."""
    n = len(normal_n)
    return States(
        contact_mm=np.tile(AT_MM, (n, 1)),
        force_n=normal_n,
        shear_n=np.outer(tangential_n, [0.0, 1.0, 0.0]),
        torsion_nmm=np.zeros(n),
        tip_radius_mm=np.full(n, 3.0),
        warm_c=np.zeros(n),
        slip_mm_s=speed_mm_s,
    )


def grasp(thing: Thing, seed: int, trained: grip.Trained | None) -> np.ndarray:
    """Hold ``thing``, and tighten where the grip is about to give, if ``trained``. Returns what was felt (n, 2)."""
    felt, believes = Felt(seed), None if trained is None else grip.GripFilter(trained)
    press_n, tightens, seen = HELD_N, False, []
    while len(thing.rounds) < GRASP_S / ROUND_S and thing.slid_mm < LOST_MM:
        for _ in range(BLOCK):
            press_n = min(press_n + tightens * TIGHTEN_N_PER_S * ROUND_S, MOST_N)
            closed = min(max(len(thing.rounds) * ROUND_S - CLOSED_S, 0.0) / 0.3, 1.0)
            thing.go_on(closed * press_n)
        if believes is not None:
            seen.append(felt.latest(thing))
            heard = seen[-1].copy()
            heard[:, 0] = np.nan if tightens else heard[:, 0]  # its own squeeze sounds like a slip
            if len(thing.rounds) > LEARN_FROM:
                gives = believes.feed(heard)[-1, grip.GripState.STABLE] < 0.5
                tightens = gives or heard[:, 1].mean() > (1 - RESERVE) * trained.friction
    return np.concatenate(seen) if seen else felt.latest(thing)


def learn(seeds: range) -> grip.Trained:
    """From grasps that were let slip."""
    seen, states = [], []
    for seed in seeds:
        thing = Thing(mass_kg=0.18, lift_s=2.0)
        seen.append(grasp(thing, seed, None)[LEARN_FROM:])
        states.append(thing.states()[LEARN_FROM:])
    return grip.train(np.concatenate(seen), np.concatenate(states))


if __name__ == "__main__":
    trained = learn(range(4))
    for name, grip_model in (("grip not changed", None), ("tightened", trained)):
        thing = Thing(mass_kg=0.25, lift_s=2.0)
        grasp(thing, 100, grip_model)
        lost = "lost" if thing.slid_mm >= LOST_MM else "kept"
        print(f"{name}: {lost}, slid {thing.slid_mm:.1f} mm, pressed with {thing.rounds[-1][0]:.1f} N at the end")
