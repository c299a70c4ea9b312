"""A stream that stops, and a board that goes away and comes back: found out, told, started again. No time passes."""

from __future__ import annotations

import termios
import threading
from contextlib import suppress
from types import SimpleNamespace

import pytest
from live_board import Firmware, Live, frame, gaps_of, heartbeat, until
from maps import make_map

import biotac
from biotac.board import recovery
from biotac.board.connection import Connection, State
from biotac.board.lasting import Lasting
from biotac.wire import messages_gen as wire

OTHER = (8,) * 12
HELD = int(wire.FrameFlags.HELD)


def stops_at_the_next_look(firmware: Firmware, after_us: int) -> None:
    """It has heard nothing for so long, and says so."""
    status = firmware.status

    def stopped(req_id: int = 0) -> wire.Status:
        firmware.status, firmware.streams = status, 0
        firmware.t_us += after_us
        return status(req_id)

    firmware.status = stopped


# ---- it answers, but does not stream -------------------------------------------------------------


def test_a_started_stream_is_looked_at_at_once(live: Live, monkeypatch) -> None:
    monkeypatch.setattr(recovery, "LOOK_S", 600.0)
    live.hand.stream()
    live.firmware.wait_for(wire.GetStatus)
    live.hand.stream("raw")
    live.firmware.wait_for(wire.GetStatus, 2)


def test_looks_keep_a_stream_alive_and_are_nobody_elses(live: Live, quick) -> None:
    seen: list[wire.Status] = []
    live.hand.on_status(seen.append)
    live.hand.stream()
    live.firmware.wait_for_looks(50)
    assert live.hand.status().req_id > 0  # asked for by the program, it is the program's
    until(lambda: len(seen) == 1)
    live.hand.stop()
    looks = len(live.firmware.received(wire.GetStatus))
    live.hand.ping()
    live.hand.ping()
    assert len(live.firmware.received(wire.GetStatus)) == looks
    assert len(live.firmware.received(wire.Start)) == 1


def test_a_stream_that_another_host_took_is_a_lost_board(live: Live, quick) -> None:
    live.hand.stream()
    live.firmware.wait_for_looks()
    live.firmware.streams = 0b100
    with pytest.raises(biotac.DeviceLostError, match=r"another program, or the board's other port, took the stream"):
        live.hand.read(1.0)
    assert len(live.firmware.received(wire.Start)) == 1 and not live.hand.connected


@pytest.mark.parametrize("pause_s", [0.09, 600.0, 4500.0])
def test_a_board_that_heard_nothing_for_too_long_is_started_again(live: Live, quick, pause_s: float) -> None:
    """Even one with a clock, of 71.6 min, that has begun again meanwhile."""
    missed = round(100 * pause_s)
    gaps = gaps_of(live.hand)
    live.hand.stream("force")
    live.send(frame(1), frame(1, finger=2))
    live.firmware.wait_for_looks()
    live.firmware.after[wire.Start] = frame(2 + missed) + frame(2 + missed, finger=2)
    live.firmware.t_us += 10_000 * missed
    live.firmware.faults, live.firmware.streams = int(wire.FaultFlags.HOST_SILENT), 0
    until(gaps)
    (gap,) = gaps()
    assert (gap.reason, gap.last_t_us, gap.next_t_us) == ("paused", 10_000, 10_000 * (2 + missed))
    assert (gap.fingers, gap.frames_missed, gap.holds_lapsed, gap.boot_id) == (0b101, 2 * missed, 0, 1)
    first, again = live.firmware.received(wire.Start)
    assert (first.streams, first.fingers, first.keepalive_ms) == (again.streams, again.fingers, again.keepalive_ms)
    subscribed, renewed = live.firmware.received(wire.Subscribe)  # the HELLO of the look made the board forget it
    assert subscribed.quantities == renewed.quantities
    live.firmware.wait_for_looks()  # the fault is latched, and not new any more
    assert live.hand.connected and len(live.firmware.received(wire.Start)) == 2


def test_a_board_that_may_have_heard_nothing_by_its_own_clock_was_not_taken(live: Live, quick) -> None:
    """HOST_SILENT is latched since an earlier pause, and this computer's clock stood still in its sleep."""
    gaps = gaps_of(live.hand)
    live.firmware.faults = int(wire.FaultFlags.HOST_SILENT)
    live.hand.stream()
    live.send(frame(1))
    live.firmware.wait_for_looks()
    live.firmware.after[wire.Start] = frame(110)
    stops_at_the_next_look(live.firmware, after_us=999_000)  # a question is heard before it is answered
    until(lambda: live.hand.check() or gaps())
    assert gaps()[0].reason == "paused"


def test_a_program_that_is_stopped_again_before_the_next_row_is_no_silent_board(live: Live, quick) -> None:
    gaps = gaps_of(live.hand)
    live.hand.stream()
    live.send(frame(1))
    live.firmware.wait_for_looks()
    live.firmware.idle = False
    for starts in (2, 3, 4):
        stops_at_the_next_look(live.firmware, after_us=999_000)
        until(lambda: live.hand.check() or len(live.firmware.received(wire.Start)) >= starts)  # noqa: B023 - called at once
    live.send(frame(400))
    until(lambda: live.hand.check() or gaps())
    assert [gap.reason for gap in gaps()] == ["paused"]


def test_a_stream_without_rows_is_started_again_once_and_then_lost(live: Live, quick) -> None:
    gaps = gaps_of(live.hand)
    live.hand.stream()
    live.send(frame(1))
    live.firmware.after[wire.Start] = frame(2)
    live.firmware.idle = False
    until(gaps)
    assert gaps()[0].reason == "silence"
    with pytest.raises(biotac.DeviceLostError, match="answers, but its stream stays silent; look for the cause"):
        live.hand.read(100.0)
    assert len(live.firmware.received(wire.Start)) == 2  # by the program, and once more


@pytest.mark.parametrize("how", [{"fingers_present": 0}, {}])
def test_where_no_rows_are_due_none_are_missed(scripted_board, hello, quick, how) -> None:
    firmware = Firmware(hello, **how)
    live = Live(scripted_board(firmware), firmware)
    firmware.idle = False
    live.hand.stream("status")
    firmware.wait_for_looks(20)
    live.hand.check()
    live.hand.close()
    assert len(firmware.received(wire.Start)) == 1


def test_a_board_that_does_not_answer_is_lost(live: Live, quick) -> None:
    live.hand.stream()
    live.firmware.wait_for_looks()
    live.firmware.mute = {wire.GetStatus}
    live.hand.link.patience = 0.01
    with pytest.raises(biotac.DeviceLostError, match="did not answer GetStatus"):
        live.hand.read(1.0)


def test_a_board_that_restarted_while_nothing_streamed_is_found_out(live: Live, quick) -> None:
    live.firmware.facts["boot_id"] = 2
    live.hand.stream()
    with pytest.raises(biotac.DeviceLostError, match="restarted; open it again"):
        live.hand.read(1.0)


def test_another_program_that_changes_the_ports_settings_is_named(live: Live, quick) -> None:
    live.hand.stream()
    settings = termios.tcgetattr(live.hand.link.fd)
    settings[3] |= termios.ICANON
    termios.tcsetattr(live.hand.link.fd, termios.TCSANOW, settings)
    live.send(frame(1), b"\4", b"\4")  # the terminal's end of file
    with pytest.raises(biotac.DeviceLostError, match=r"changed the settings of .*, as `stty` does"):
        live.hand.read(1.0)


@pytest.mark.parametrize("moment", ["close", "stop"])
def test_ending_a_stream_is_nobody_taking_it(scripted_board, hello, quick, moment) -> None:
    for _ in range(20):
        firmware = Firmware(hello)
        live = Live(board := scripted_board(firmware), firmware)
        live.hand.stream()
        if moment == "stop":
            live.hand.stop()
        live.hand.close()
        board.close()


# ---- holes in the stream -------------------------------------------------------------------------


@pytest.mark.parametrize("pieces", [1, 2])
@pytest.mark.parametrize(("next_seq", "next_us", "reason"), [(101, 1_010_000, "lost"), (2, 1_010_000, "finger")])
def test_rows_that_are_missing_are_told(live: Live, pieces, next_seq, next_us, reason) -> None:
    gaps = gaps_of(live.hand)
    live.hand.stream()
    live.send(frame(0), frame(0, finger=1))
    until(lambda: live.hand[1].t_us == 0)
    rows = [frame(1), frame(1, finger=1), frame(4, finger=1), frame(next_seq, t_us=next_us)]
    for piece in [rows] if pieces == 1 else [rows[:3], rows[3:]]:
        live.send(*piece)
    until(gaps)
    (gap,) = gaps()
    assert (gap.reason, gap.fingers, gap.boot_id) == (reason, 0b1, 1)
    assert (gap.last_t_us, gap.next_t_us) == (10_000, next_us)
    assert gap.back_at_ns - gap.lost_at_ns >= 1000 * (next_us - gap.last_t_us)


def test_heartbeats_cover_their_time_and_short_losses_are_only_counted(live: Live) -> None:
    live.hand.stream(rest=False)
    live.send(frame(1))
    live.send(heartbeat(101, frames=100))
    live.send(frame(110))
    live.hand.ping()
    assert live.hand.stats.gaps == 0 and live.hand.stats.frames_lost == 8


@pytest.mark.parametrize("reconnects", [False, True])
def test_a_connection_has_one_state_and_all_who_wait_hear_of_each(reconnects: bool) -> None:
    link, heard = SimpleNamespace(port="x", spoilt=lambda: "", ports=lambda: ["x"]), []
    connection = Connection(link, reconnects=reconnects)
    connection.on_wake(lambda: heard.append(connection.state))
    connection.streams(wire.Start(0, 1, 1, 0))
    assert connection.state is State.STREAMING
    connection.lose(biotac.DeviceLostError("gone"), "unplugged")
    assert heard == [State.LOST if reconnects else State.CLOSED]
    connection.find()
    connection.streams(None)
    assert connection.state is (State.OPEN if reconnects else State.CLOSED)
    connection.close()
    connection.fail(ValueError("closed before"))
    with pytest.raises(biotac.DeviceLostError, match="was closed" if reconnects else "gone"):
        connection.raise_closed()


# ---- a board that was lost -----------------------------------------------------------------------


def test_without_reconnect_a_pulled_cable_is_an_error(world) -> None:
    live = world.opened(plugged := world.plug(), reconnect=False)
    live.hand.stream()
    world.unplug(plugged)
    for _ in range(2):
        with pytest.raises(biotac.DeviceLostError, match="went away while it was open"):
            live.hand.read(1.0)
    assert not live.hand.connected
    live.hand.close()  # told before


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


# ---- holds ---------------------------------------------------------------------------------------


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
