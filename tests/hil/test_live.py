"""A cable pulled, and power cut, under a hand that is to come back by itself."""

import numpy as np
import pytest

import biotac
from biotac.wire import messages_gen as wire


@pytest.mark.parametrize(
    ("ability", "verbs", "reason"), [("cable", ["unplug", "plug"], "silence"), ("power", ["cut power"], "rebooted")]
)
def test_a_hand_comes_back_by_itself(rig, ability: str, verbs: list[str], reason: str) -> None:
    rig.need(ability)
    with rig.open("press.toml?fingers=2&seconds=600", reconnect=True) as hand:
        hand.board.set_setting(wire.Setting.IDLE_PERIOD_MS, 70)
        hand.stream("force", "raw")
        before = hand.info.boot_id
        gap = None
        acted = False
        for batch in hand.batches():
            if not acted and len(batch.wire):
                for verb in verbs:
                    hand.link.board.send_line(verb)
                # From now on the test waits for silence: until here a busy computer made none.
                hand.link.patience = 1.0
                acted = True
            gap = gap or next((m for m in batch.messages if isinstance(m, biotac.Gap)), None)
            if gap is not None:
                break
        assert gap is not None and gap.reason == reason
        assert gap.lost_at_ns < gap.back_at_ns
        assert (hand.info.boot_id != before) == (reason == "rebooted")
        assert hand.board.setting(wire.Setting.IDLE_PERIOD_MS) == 70
        assert (batch.frames["flags"] & biotac.FrameFlags.NOT_ASKED != 0).all()
        assert hand.stats.gaps == 1


def test_forces_by_name_follow_the_board(board) -> None:
    hand = board("press.toml?fingers=2&seconds=4")
    touches: list[int] = []
    hand.on_touch(lambda touch: touches.append(touch.finger))
    hand.stream()
    most_n = max(np.nanmax(batch.frames["force_n"][:, 2], initial=0.0) for batch in hand.batches())
    assert hand.stats.frames_lost == 0
    assert set(touches) == {0, 1}
    assert most_n > 1.0
    assert hand["middle"].t_us > 3_900_000
