"""Is a hold ever forgotten, or told to have lapsed while the board keeps it? Seeded courses of holds in virtual time.

The board restarts, hangs, loses the host and is plugged in again; sensors are exchanged, or silent; nothing streams for
so long that holds lapse. The program's holds, less those a Gap told of, are compared with HELD in the newest rows.
"""

import os
import random
from contextlib import suppress

import pytest

import biotac
from biotac.board.reader import Consumer
from biotac.sim import SimFinger, world
from biotac.sim.world import LockStep

NIGHTLY = bool(os.environ.get("BIOTAC_NIGHTLY"))
HOLDS = 250  # in each course: 500 by day, 10 000 at night
NAMES = ("index", "middle", "thumb")
HELD = biotac.FrameFlags.HELD


class Program(Consumer):
    """The holds that a program believes in if it listens to every Gap."""

    def __init__(self, w: LockStep) -> None:
        self.w = w
        self.held: set[str] = set()
        self.holds = self.lapses = 0
        self.false: list[biotac.Gap] = []  # told of a finger with HELD in all rows of that batch
        self._told: list[int] = []
        w.hand.add(self)

    def put(self, batch: biotac.Batch) -> None:
        for gap in (m for m in batch.messages if isinstance(m, biotac.Gap) and m.holds_lapsed):
            fingers = [*batch.wire["finger"][batch.wire["flags"] & int(HELD) == 0]]
            fingers += [*batch.idle["finger"][batch.idle["flags"] & int(HELD) == 0]]
            self._told.append(gap.holds_lapsed)
            self.false += [gap] * any(gap.holds_lapsed >> f & 1 and f not in fingers for f in range(5))

    def hear(self) -> None:
        """Take in a Gap; telling of a finger that was not held is false, too."""
        while self._told:
            lapsed = {name for k, name in enumerate(NAMES) if self._told[0] >> k & 1}
            assert lapsed <= self.held, f"told {lapsed}, held {self.held}"
            self.held -= lapsed
            self.lapses += len(lapsed)
            del self._told[0]

    def hold(self, names: list[str]) -> None:
        with suppress(biotac.DeviceLostError):
            self.w.hand.hold(*names)
            self.hear()
            self.held |= set(names)
            self.holds += len(names)

    def release(self, names: list[str]) -> None:
        self.hear()
        with suppress(biotac.DeviceLostError):
            self.held -= set(names)
            self.w.hand.release(*names)

    def leave_grasp(self, names: list[str]) -> None:
        """By an error, also for a board that is away: RELEASE is repeated until it is answered."""
        with suppress(biotac.DeviceLostError, ZeroDivisionError), self.w.hand.grasp(*names):
            self.hear()
            self.held |= set(names)
            self.holds += len(names)
            self.w.run(0.1)
            self.hear()
            _ = 1 / 0
        self.hear()
        self.held -= set(names)

    def compare(self) -> None:
        """For each finger that has a row by now."""
        now = self.w.run(0.1)
        self.hear()
        rows = {name: bool(one.frame.flags & HELD) for name, one in now.fingers.items() if one.frame is not None}
        assert {name: name in self.held for name in rows} == rows
        assert self.false == []


def disturb(w: LockStep, rng: random.Random, program: Program) -> None:
    what = rng.choice(("unplug", "restart", "hang", "pause", "exchange", "silent", "silent"))
    if what == "unplug":
        w.unplug(rng.choice((0.2, 1.0, 3.0)))
    elif what == "restart":
        w.restart()
    elif what == "hang":
        w.hang()
        w.run(3.0)
    elif what == "pause" and w.hand.connected:
        w.hand.stop()
        w.run(rng.choice((0.5, 3.0)))
        w.hand.start()
    else:
        w.fault(rng.choice(NAMES), "swapped" if what == "exchange" else "unplugged")
        w.run(rng.choice((0.1, 0.3, 3.0)))
    for _ in range(rng.randrange(3)):  # also while it is away, and while a finger is silent
        act(rng, program)
    w.run(rng.choice((0.05, 4.0)))
    if rng.random() < 0.7:
        for name in NAMES:
            w.fault(name, None)


def act(rng: random.Random, program: Program) -> None:
    names = rng.sample(NAMES, rng.randint(1, len(NAMES)))
    rng.choices((program.hold, program.release, program.leave_grasp), (6, 3, 1))[0](names)


@pytest.mark.parametrize("seed", range(40 if NIGHTLY else 2))
def test_no_hold_is_forgotten_and_none_is_told_falsely(seed: int) -> None:
    rng = random.Random(seed)
    with world({name: SimFinger(k + 1) for k, name in enumerate(NAMES)}) as w:
        w.run(1.0)
        program = Program(w)
        while program.holds < HOLDS:
            act(rng, program)
            program.compare()
            if rng.random() < 0.5:
                disturb(w, rng, program)
                program.compare()
        assert program.lapses > HOLDS // 20
