"""Tares kept over a restart in a grip, and a HOLD that lasts where time waits for the reader."""

import os

import numpy as np
import pytest

import biotac
from biotac import FrameFlags, Trust
from biotac.sim import SimFinger, SimTouch, world

NAMES = ("index", "middle", "ring", "little", "thumb")
WORLDS = 10 if os.environ.get("BIOTAC_NIGHTLY") else 2
OFF_N, MISSES_OF_TEN = 0.5, 1
TOUCH_N, BACK_ROUNDS = 2.0, 100


@pytest.mark.parametrize("pace", [0.0, 20.0])
def test_a_hold_is_in_every_frame_at_every_pace(pace: float) -> None:
    with biotac.open("sim:press.toml?seconds=6", pace=pace) as hand:
        hand.stream("results")
        hand.read_batch(0.1)
        hand.hold()
        held = np.concatenate([batch.frames["flags"] & FrameFlags.HELD for batch in hand.batches()])
    since = held[int((held != 0).argmax()) :]  # frames that were on their way
    assert len(since) > 300 and (since != 0).all()


def test_a_board_that_restarts_in_a_grip_has_its_force_again_within_a_second() -> None:
    """Fingers, places and forces at random: the mean of half a second, against that before."""
    good = 0
    for number in range(WORLDS):
        rng = np.random.default_rng(number)
        profiles = ["worn" if rng.random() < 0.5 else "new" for _ in NAMES]
        fingers = {name: SimFinger(int(rng.integers(1000)), of) for name, of in zip(NAMES, profiles, strict=True)}
        with world(fingers) as hand:
            hand.run(3.0)
            hand.run(0.4, **dict.fromkeys(NAMES, SimTouch(TOUCH_N, at="E17")))  # which confirms their tares
            hand.run(2.5)
            loads = {name: SimTouch(float(rng.uniform(0.5, 6)), at=f"E{rng.integers(1, 20)}") for name in NAMES}
            hand.run(1.5, **loads)
            before = np.mean([[hand.step(**loads)[n].frame.force_n for n in NAMES] for _ in range(10)], axis=0)
            hand.restart()
            while hand.step(**loads).seq < 0:
                pass
            rounds = [hand.step(**loads) for _ in range(BACK_ROUNDS + 50)][BACK_ROUNDS:]
        after = np.mean([[now[n].frame.force_n for n in NAMES] for now in rounds], axis=0)
        trusted = np.array([[now[n].frame.trust >= Trust.INTERVAL for n in NAMES] for now in rounds]).all(axis=0)
        good += int((trusted & (np.linalg.norm(after - before, axis=1) <= OFF_N)).sum())
    print(f"\nforce again within {OFF_N} N, and trusted: {good} of {WORLDS * len(NAMES)}")
    assert good >= WORLDS * len(NAMES) * (10 - MISSES_OF_TEN) // 10
