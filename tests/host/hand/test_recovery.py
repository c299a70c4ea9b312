"""A board that goes away and comes back: found out, told, restored. No time passes."""

import threading
from contextlib import suppress
from types import SimpleNamespace

import pytest
from live_board import frame, gaps_of, heartbeat, stops_at_the_next_look, until

import biotac
from biotac.wire import messages_gen as wire

OTHER = (8,) * 12


@pytest.mark.parametrize(("boot_id", "reason"), [(1, "unplugged"), (2, "rebooted")])
def test_a_board_that_comes_back_is_told_all_again_and_the_gap_is_marked(world, boot_id, reason) -> None:
    live = world.opened(plugged := world.plug(boot_id=1))
    hand, back = live.hand, []
    for setting, value in ((1, 2), (2, 50), (1, 0)):
        hand.board.set_setting(setting, value)
    hand.stream("force", "pac", rest=False)
    gaps = gaps_of(hand)
    hand.hold(0)
    live.send(frame(10), frame(11))
    until(lambda: hand[0].t_us == 110_000)

    def return_at_third(pauses: int) -> None:
        if pauses == 3:
            back.append(world.plug(boot_id=boot_id))
            back[0].firmware.after[wire.Start] = frame(50)

    world.clock.while_away = return_at_third
    live.send(b"\x01half a fra")
    world.unplug(plugged)
    until(gaps)
    (gap,), firmware = gaps(), back[0].firmware
    assert (gap.reason, gap.last_t_us, gap.next_t_us, gap.boot_id) == (reason, 110_000, 500_000, boot_id)
    assert (gap.holds_lapsed, firmware.received(wire.Hold)) == (1, [])  # nothing renews a hold
    assert gap.frames_missed == (None if boot_id == 2 else 38)
    assert world.clock.pauses == 3 and gap.back_at_ns >= gap.lost_at_ns
    assert [(m.setting, m.value) for m in firmware.received(wire.SetSetting)] == [(2, 50), (1, 0)]
    assert [m.quantities for m in firmware.received(wire.Subscribe)] == [wire.QuantityFlags.FORCE]
    assert [(m.streams, m.keepalive_ms) for m in firmware.received(wire.Start)] == [(0b111, 1000)]
    assert hand.stats.gaps == 1 and hand.connected and hand[0].t_us == 500_000


def test_a_board_that_came_back_and_stopped_at_once_was_not_taken(world, quick) -> None:
    """The board may have heard START long before the reply came here."""
    live = world.opened(plugged := world.plug(boot_id=1))
    plugged.firmware.faults = int(wire.FaultFlags.HOST_SILENT)
    live.hand.stream()
    live.send(frame(1))
    plugged.firmware.wait_for_looks()
    back = []

    def come_back(pauses: int) -> None:
        back.append(world.plug(boot_id=1).firmware)
        back[0].faults, back[0].t_us = int(wire.FaultFlags.HOST_SILENT), plugged.firmware.t_us
        stops_at_the_next_look(back[0], after_us=0)

    world.clock.while_away = come_back
    world.unplug(plugged)
    until(lambda: live.hand.check() or (back and len(back[0].received(wire.Start)) == 2))
    back[0].wait_for_looks()
    assert live.hand.connected


def test_a_board_that_comes_back_and_refuses_what_it_had_ends_the_hand_in_words(world) -> None:
    # The stream must not go on: the forces would rest on another setting than the program's.
    live = world.opened(plugged := world.plug(boot_id=1))
    live.hand.board.set_setting(2, 50)
    live.hand.stream()
    live.send(frame(1))
    world.clock.while_away = lambda pauses: world.plug(boot_id=2).firmware.refuses.update(
        {wire.SetSetting: wire.Error.OUT_OF_RANGE}
    )
    world.unplug(plugged)
    with pytest.raises(
        biotac.CommandRefusedError, match=r"came back, but not with its setting 2: .*OUT_OF_RANGE"
    ) as refused:
        live.hand.read(1000.0)
    assert refused.value.error == wire.Error.OUT_OF_RANGE and not live.hand.connected


def test_a_reboot_behind_the_same_port_is_an_error_or_is_mended(world, quick) -> None:
    for reconnect in (False, True):
        live = world.opened(plugged := world.plug(boot_id=1), reconnect=reconnect)
        live.hand.board.set_setting(1, 2)
        gaps = gaps_of(live.hand)
        live.hand.stream()
        live.send(frame(1000))
        plugged.firmware.wait_for_looks()
        plugged.firmware.facts["boot_id"], plugged.firmware.streams = 2, 0
        plugged.firmware.t_us = 0
        plugged.firmware.after[wire.Start] = frame(1)
        if not reconnect:
            with pytest.raises(biotac.DeviceLostError, match="restarted; open it again"):
                live.hand.read(1000.0)
            with suppress(biotac.DeviceLostError):
                live.hand.close()
    until(gaps)
    assert (gaps()[0].reason, gaps()[0].next_t_us, live.hand.info.boot_id) == ("rebooted", 10_000, 2)
    assert [m.value for m in plugged.firmware.received(wire.SetSetting)] == [2, 2]
    assert live.hand.stats.disordered == 0  # numbers that restart are no step back


@pytest.mark.parametrize("has_its_own", [False, True], ids=["without tares", "a watchdog's reset kept them"])
def test_a_tare_is_given_back_though_the_last_round_had_no_trust_and_the_finger_rested(world, has_its_own) -> None:
    """Sagging power spoils words first; and heartbeats of a resting finger come with others' frames.

    The board keeps the tare itself over a hang, held if it was: one given back would only be likely.
    """
    live = world.opened(plugged := world.plug(boot_id=1))
    live.hand.stream(rest=False)
    live.send(frame(10, 0, trust=wire.Trust.ACT), frame(10, 1, trust=wire.Trust.ACT))
    until(lambda: live.hand[1].t_us == 100_000)
    live.send(frame(11, 0, trust=wire.Trust.HOLD), heartbeat(11, 1))
    until(lambda: live.hand[1].t_us == 110_000)
    back: list[SimpleNamespace] = []

    def while_away(pauses: int) -> None:
        back.append(world.plug(boot_id=2))
        back[-1].firmware.after[wire.Start] = frame(1)
        back[-1].firmware.tare_reason = wire.TareReason.RESTORED if has_its_own else wire.TareReason.START

    world.clock.while_away = while_away
    gaps = gaps_of(live.hand)
    world.unplug(plugged)
    until(gaps)
    assert [m.finger for m in back[-1].firmware.received(wire.TareSet)] == ([] if has_its_own else [0, 1])


def test_a_stranger_on_the_same_port_gets_no_commands(world) -> None:
    live = world.opened(plugged := world.plug(boot_id=1))
    live.hand.stream()
    strangers, refusals = [], []

    def command() -> None:
        with pytest.raises(biotac.DeviceLostError, match="is away and being looked for"):
            live.hand.ping()
        refusals.append(live.hand[0].stale)

    world.away(
        plugged, lambda: strangers.append(world.plug(board_serial=OTHER)), command, lambda: world.plug(boot_id=1)
    )
    assert {type(m) for m in strangers[0].firmware.commands} == {wire.Stop, wire.HelloRequest}
    assert refusals == ["the board is away and being looked for"]
    live.hand.ping()


def test_a_board_that_is_lost_while_it_is_restored_is_restored_again(world) -> None:
    live = world.opened(plugged := world.plug(boot_id=1))
    live.hand.board.set_setting(1, 2)
    gaps = gaps_of(live.hand)
    live.hand.stream()
    live.send(frame(10))
    until(lambda: live.hand[0].t_us == 100_000)
    back = []

    def while_away(pauses: int) -> None:
        back.append(world.plug(boot_id=2))
        firmware = back[-1].firmware
        if pauses == 1:
            firmware.mute = {wire.SetSetting}
            threading.Thread(target=lambda: (firmware.wait_for(wire.SetSetting), world.unplug(back[0]))).start()
        firmware.after[wire.Start] = frame(1)

    world.clock.while_away = while_away
    world.unplug(plugged)
    until(gaps)
    assert [gap.reason for gap in gaps()] == ["rebooted"]
    assert [m.value for m in back[-1].firmware.received(wire.SetSetting)] == [2]


def test_a_stream_that_is_stopped_while_the_board_is_away_stays_stopped(world) -> None:
    live = world.opened(plugged := world.plug())
    live.hand.stream()
    back = []

    def while_away(pauses: int) -> None:
        if pauses == 1:
            thread = threading.Thread(target=lambda: suppress(biotac.DeviceLostError).__enter__() or stop())
            thread.start()
            thread.join()
            back.append(world.plug())

    def stop() -> None:
        with suppress(biotac.DeviceLostError):
            live.hand.stop()

    world.clock.while_away = while_away
    world.unplug(plugged)
    until(lambda: live.hand.connected and back)
    live.hand.ping()
    assert back[0].firmware.received(wire.Start) == [] and not live.hand.streaming


def test_close_ends_the_search(world) -> None:
    live = world.opened(plugged := world.plug())
    live.hand.stream()
    world.unplug(plugged)
    until(lambda: world.clock.pauses > 3)
    live.hand.close()
    assert live.hand.closed
