"""A stream that stops, and rows that are missing: found out, told, started again. No time passes."""

import termios
from types import SimpleNamespace

import pytest
from live_board import Firmware, Live, frame, gaps_of, heartbeat, stops_at_the_next_look, until

import biotac
from biotac.board.connection import Connection, State
from biotac.wire import messages_gen as wire


def test_a_started_stream_is_looked_at_at_once(live: Live, look_every) -> None:
    look_every(600.0)  # a look of its own accord would hide one that is missing
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
