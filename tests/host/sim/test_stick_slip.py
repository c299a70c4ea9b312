"""Skin that slides: the dynamic pressure of the emulated finger, and that a board calls it slip."""

import numpy as np
import pytest
from pac_events import pac_events

import biotac
from biotac import EventKind
from biotac.sim.stick_slip import Ringing

HELD = 60  # rounds


@pytest.mark.parametrize("speed_mm_s", [5.0, 20.0, 40.0])
def test_the_onset_of_a_slip_is_told_within_five_milliseconds(speed_mm_s: float) -> None:
    off_ms, late_ms = [], []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        speed = np.zeros(2 * HELD)
        speed[HELD:] = speed_mm_s
        pac = np.rint(2038 + Ringing(rng)(speed) + rng.normal(0.0, 5.0, (2 * HELD, 22))).astype(int)
        events, _ = pac_events(np.clip(pac, 0, 4095))
        slip = events[events["kind"] == EventKind.SLIP][0]
        off_ms.append(int(slip["onset_us"]) / 1000 - 10 * HELD)
        late_ms.append(int(slip["t_us"]) / 1000 - 10 * HELD)
    assert np.mean(np.abs(off_ms) <= 5.0) >= 0.95
    assert np.mean(np.array(late_ms) <= 10.0) >= 0.95  # heard of within a round


def test_its_strength_is_that_of_real_slides_and_a_longer_run_begins_alike() -> None:
    speed = np.full(3000, 20.0)
    pac = Ringing(np.random.default_rng(1))(speed)
    flat = pac.ravel()
    assert 1300 <= np.mean((flat[8:] - flat[:-8]) ** 2) <= 6000
    np.testing.assert_array_equal(Ringing(np.random.default_rng(1))(speed[:100]), pac[:100])
    assert not Ringing(np.random.default_rng(1))(np.zeros(100)).any()


def test_a_grasp_is_told_from_touch_to_release() -> None:
    with biotac.open("sim:grasp.toml") as hand:
        hand.stream("events", "raw")
        events = [m for m in hand.read_batch(20.0).messages if isinstance(m, biotac.Event)]
    at_s = {kind: [m.t_us / 1e6 for m in events if m.kind == kind] for kind in EventKind}
    assert 1.5 <= at_s[EventKind.TOUCH][0] <= 1.7
    # 0.1 s after the power came. Letting go at 20 N/s drags the skin: that is told as a slip, too.
    assert [round(s, 2) for s in at_s[EventKind.SLIP] if s < 8.0] == [4.91]
    assert len(at_s[EventKind.SLIP]) == len(at_s[EventKind.STUCK])
    assert 8.6 <= at_s[EventKind.LIFT][-1] <= 9.2  # the residue of a finger as sensitive as real ones takes 0.3 s more
