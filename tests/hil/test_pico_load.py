"""The Pico at its busiest: five fingers pressed, each with the largest map, its flash as slow as a real one."""

from __future__ import annotations

from typing import Any

import pytest
from maps import BIG, make_map
from rig import Rig

from biotac import FrameFlags, QuantityFlags

FINGERS = 5
SECONDS = 2


@pytest.mark.long
def test_five_fingers_with_the_largest_map_lose_nothing(rig: Rig) -> None:
    rig.need("counters")
    hand = rig.open(f"press.toml?fingers={FINGERS}&seconds={SECONDS}&pace=fast")
    for finger in range(FINGERS):
        hand.set_map(finger, make_map(finger, blocks=BIG))
    assert len(hand.read(100)) == FINGERS * 100 * SECONDS
    status = hand.status()
    assert (status.slots_late, status.messages_dropped) == (0, 0)
    counters = hand.link.board.counters()  # type: ignore[attr-defined]
    assert counters["watchdog_resets"] == 0
    assert counters["slept"] >= 0.2


@pytest.mark.long
def test_at_150_percent_work_is_shed_in_order_and_slots_and_commands_are_kept(rig: Rig) -> None:
    """The core is slowed down until what it has to do takes half as long again as there is time."""
    rig.need("counters")
    hand = rig.open(f"press.toml?fingers={FINGERS}&seconds=20&pace=fast")
    for finger in range(FINGERS):
        hand.set_map(finger, make_map(finger, blocks=BIG))
    hand.subscribe(QuantityFlags(0x7F))
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
    assert status.sigma_shed > 0
    assert status.wrench_repeated > 0
    repeated = rows["flags"] & FrameFlags.REPEATED != 0
    assert repeated.any()
    assert (rows["wrench_age_ms"][~repeated] == 0).all()
    assert (rows["wrench_age_ms"][repeated] <= 100).all()
    lost = FINGERS * 300 - len(rows)
    assert abs(lost - status.frames_shed) <= FINGERS * 2  # counted, but for what came before and after the reading


def slept_s(counters: dict[str, Any]) -> float:
    return float(counters["slept"] * counters["emulated_s"])
