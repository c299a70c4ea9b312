"""Holds and releases across gaps, lost boards and exceptions, and what is remembered for a restart. No time passes."""

import threading

import pytest
from live_board import Live, frame, gaps_of, heartbeat, until
from maps import make_map

import biotac
from biotac.board.lasting import Lasting
from biotac.wire import messages_gen as wire

HELD = int(wire.FrameFlags.HELD)


def lapse(live: Live, *rows: bytes) -> None:
    live.firmware.wait_for_looks()
    live.firmware.after[wire.Start] = b"".join(rows)
    live.firmware.faults, live.firmware.streams = int(wire.FaultFlags.HOST_SILENT), 0


def test_a_hold_that_lapsed_is_in_the_gap_and_is_not_renewed(live: Live, quick) -> None:
    gaps = gaps_of(live.hand)
    live.hand.stream()
    live.hand.hold(0, 1)
    live.send(frame(1, flags=HELD), frame(1, finger=1, flags=HELD))
    lapse(live, frame(10, finger=1, flags=HELD), frame(11, finger=1, flags=HELD), frame(11))
    until(gaps)
    assert gaps()[0].holds_lapsed == 0b1
    assert len(live.firmware.received(wire.Hold)) == 1


def test_a_hold_that_comes_while_held_fingers_are_awaited_after_a_loss_is_kept(live: Live, quick) -> None:
    gaps = gaps_of(live.hand)
    live.hand.stream()
    live.hand.hold(0)
    live.send(frame(1, flags=HELD), frame(1, finger=1))
    lapse(live, frame(200, finger=1))
    live.firmware.wait_for(wire.Start, 2)
    live.hand.ping()  # that row has been read, and finger 0 is silent
    live.hand.hold(1)
    live.send(frame(201, flags=HELD))
    until(gaps)
    live.send(frame(202, finger=1, flags=HELD))
    assert [gap.holds_lapsed for gap in gaps()] == [0]
    live.firmware.faults = 0
    live.firmware.wait_for_looks()
    lapse(live, frame(400), frame(400, finger=1))
    until(lambda: len(gaps()) > 1 and live.hand[1].t_us == 4_000_000)
    live.hand.ping()
    assert sum(gap.holds_lapsed for gap in gaps()) == 0b11


def test_a_silent_finger_is_not_said_to_have_lost_its_hold_until_its_row_says_so(live: Live, quick) -> None:
    gaps = gaps_of(live.hand)
    live.hand.stream()
    live.hand.hold(0, 1)
    live.send(frame(1, flags=HELD), frame(1, finger=1, flags=HELD))
    lapse(live, frame(200, flags=HELD))
    until(gaps)
    for seq in range(201, 221):
        live.send(frame(seq, flags=HELD))
        live.hand.ping()
    assert [gap.holds_lapsed for gap in gaps()] == [0]
    live.send(frame(221, flags=HELD), frame(221, finger=1))
    until(lambda: len(gaps()) == 2)
    assert (gaps()[1].reason, gaps()[1].holds_lapsed) == ("hold", 0b10)


def test_a_row_without_its_hold_is_told_though_none_is_missing(live: Live) -> None:
    gaps = gaps_of(live.hand)
    live.hand.stream()
    live.send(frame(1))
    live.hand.ping()
    live.hand.hold(0)
    live.send(frame(2))  # was made before HOLD came
    live.send(frame(3, flags=HELD), frame(9, flags=HELD), frame(10), heartbeat(11))
    until(gaps)
    live.send(frame(12))
    live.hand.ping()
    (gap,) = gaps()
    assert (gap.reason, gap.holds_lapsed, gap.next_t_us, gap.frames_missed) == ("hold", 0b1, 100_000, 0)
    assert gap.line() == "a hold lapsed" and live.hand.stats.gaps == 0


@pytest.mark.parametrize("boot_id", [1, 2])
def test_a_release_that_a_lost_board_did_not_hear_is_repeated_once_it_is_back(world, boot_id) -> None:
    """Also given to another boot: on silicon, HOLD goes on after a watchdog's reset."""
    live, left, back = world.opened(plugged := world.plug(boot_id=1)), threading.Event(), []
    world.clock.while_away = lambda pauses: left.wait() and back.append(world.plug(boot_id=boot_id).firmware)
    live.hand.stream()
    with live.hand.grasp(0):
        world.unplug(plugged)
        until(lambda: not live.hand.connected)
    left.set()
    until(lambda: back and back[0].received(wire.Start))
    release, _ = back[0].received((wire.Release, wire.Start))  # before START: no row says HELD any more
    assert isinstance(release, wire.Release) and release.fingers == 0b1


def test_an_exception_leaves_a_grasp_at_once_and_release_is_repeated_until_it_is_answered(live: Live, quick) -> None:
    live.firmware.mute = {wire.Release}
    with pytest.raises(ZeroDivisionError), live.hand.grasp(0):
        _ = 1 / 0
    live.firmware.wait_for(wire.Release)
    live.firmware.mute = set()
    live.hand.stream()
    live.firmware.wait_for_looks(3)
    assert [release.fingers for release in live.firmware.received(wire.Release)] == [0b1, 0b1]


def test_a_new_hold_takes_the_place_of_a_release_that_was_not_answered(live: Live, quick) -> None:
    with pytest.raises(ZeroDivisionError), live.hand.grasp(0, 1):
        _ = 1 / 0
    live.hand.hold(0)
    live.hand.stream()
    live.firmware.wait_for_looks(3)
    assert [release.fingers for release in live.firmware.received(wire.Release)] == [0b11, 0b10]


def test_a_release_that_the_board_refuses_is_not_repeated(live: Live, quick) -> None:
    live.firmware.refuses[wire.Release] = wire.Error.NOT_HERE
    with pytest.raises(ZeroDivisionError), live.hand.grasp(0):
        _ = 1 / 0
    live.hand.stream()
    live.firmware.wait_for_looks(5)
    assert live.hand.connected and len(live.firmware.received(wire.Release)) == 2


@pytest.mark.parametrize("what", ["a setting", "a map"])
def test_what_a_board_has_answered_is_remembered_before_another_command_is_sent(monkeypatch, what) -> None:
    """Otherwise a board that restarts in between would not get it again."""
    remember, overtook = Lasting.remember, []

    def late(self: Lasting, *args) -> None:
        other = threading.Thread(target=lambda: overtook.append(hand.status()))
        other.start()
        other.join(0.2)
        assert not overtook
        remember(self, *args)

    monkeypatch.setattr(Lasting, "remember", late)  # no public call stands between an answer and the record of it
    with biotac.open("sim:press.toml") as hand:
        if what == "a map":
            hand.board.set_map(0, make_map(3))
        else:
            hand.board.set_setting(biotac.Setting.CONTACT_ENERGY_COUNT2, 3000)
        until(lambda: bool(overtook))
