"""The Pico at the busiest: five fingers pressed, each with the largest map, and flash as slow as a real one's."""

from pathlib import Path
from typing import Any

import numpy as np
from held_press import held_press, of_finger
from maps import BIG, make_map

import biotac
from biotac import FaultFlags, FrameFlags
from biotac.wire.messages_gen import INVALID_COUNT
from biotac.wire.sensor_gen import SLOT_HZ
from rig import Rig

FINGERS = 5
SECONDS = 2


def test_five_fingers_with_the_largest_map_lose_nothing(rig: Rig) -> None:
    rig.need("counters")
    hand = rig.open(f"press.toml?fingers={FINGERS}&seconds={SECONDS}&pace=fast")
    for finger in range(FINGERS):
        hand.board.set_map(finger, make_map(finger, blocks=BIG))
    assert len(hand.read(100)) == FINGERS * 100 * SECONDS
    status = hand.status()
    assert (status.slots_late, status.messages_dropped) == (0, 0)
    counters = hand.link.board.counters()  # type: ignore[attr-defined]
    assert counters["watchdog_resets"] == 0
    assert counters["slept"] >= 0.2


def test_at_150_percent_work_is_shed_in_order_and_slots_and_commands_are_kept(rig: Rig) -> None:
    """The core is slowed down until the work of a round takes half as long again as there is time."""
    rig.need("counters")
    hand = rig.open(f"press.toml?fingers={FINGERS}&seconds=20&pace=fast")
    for finger in range(FINGERS):
        hand.board.set_map(finger, make_map(finger, blocks=BIG))
    hand.stream("results", "touch")
    board = hand.link.board  # type: ignore[attr-defined]
    before = board.counters()
    hand.read(1.0)
    after = board.counters()
    awake = 1 - (slept_s(after) - slept_s(before)) / (after["emulated_s"] - before["emulated_s"])
    board.do(f"slow the core {1.5 / awake:.3f} times")
    rows = hand.read_batch(3.0).wire
    hand.stop()
    status, counters = hand.status(), board.counters()
    assert status.slots_late == 0
    assert counters["watchdog_resets"] == 0
    assert counters["latency"]["reply_us"] < 100_000  # STOP, and every other command
    assert status.wrench_repeated > 0
    repeated = rows["flags"] & FrameFlags.REPEATED != 0
    assert repeated.any()
    assert (rows["wrench_age_ms"][~repeated] == 0).all()
    assert (rows["wrench_age_ms"][repeated] <= 100).all()
    lost = FINGERS * 300 - len(rows)
    assert abs(lost - status.frames_shed) <= FINGERS * 2  # counted, except rounds before and after the reading


def test_slots_that_overrun_are_counted_and_marked_and_time_does_not_move(rig: Rig, tmp_path: Path) -> None:
    """For 40 ms the core is so slow that neither the sampling interrupt nor the main loop gets any work done."""
    rig.need("counters")
    source = tmp_path / "held.toml"
    source.write_text(held_press(2, hold_s=0.7))
    hand = rig.open(str(source))
    board = hand.link.board  # type: ignore[attr-defined]
    board.plan(1.6, "slow the core 100 times")
    board.plan(1.64, "slow the core 1 times")
    frames, status, counters = hand.read(100), hand.status(), board.counters()
    assert status.slots_late > 50 and status.faults & FaultFlags.SLOTS_LATE
    assert (counters["boots"], hand.stats.frames_lost) == (1, status.frames_shed)
    with biotac.open(f"sim:{source}") as other:
        whole = other.read(100)
    for finger in range(2):
        seen, played = of_finger(frames, finger), of_finger(whole, finger)
        after_us = (seen["t_us"] - seen["t_us"][0]).astype(np.int64)
        rounds, late_us = np.divmod(after_us + 1, 10_000)  # without slot 0 the round's time is worked out, to whole us
        assert (late_us <= 1_000_000 // SLOT_HZ + 1).all() and (late_us[-50:] == 1).all()
        played = played[rounds]
        came = seen["counts"] != INVALID_COUNT
        assert np.array_equal(seen["counts"][came], played["counts"][came])
        marked = seen["flags"] & FrameFlags.ELECTRODE_MISSING != 0
        assert np.array_equal(marked, ~came.all(axis=1)) and marked.any()
        off_n = np.abs(seen["force_n"] - played["force_n"]).max(axis=1)
        assert not (off_n[~marked] > 0.1).any()


def slept_s(counters: dict[str, Any]) -> float:
    return float(counters["slept"] * counters["emulated_s"])
