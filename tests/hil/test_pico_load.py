"""The Pico at its busiest: five fingers pressed, each with the largest map, its flash as slow as a real one."""

from __future__ import annotations

from maps import BIG, make_map
from rig import Rig

FINGERS = 5
SECONDS = 2


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
