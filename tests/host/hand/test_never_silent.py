"""What a hand must not keep quiet about: a board that is gone, rows that are old, names that there are not."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest
from live_board import Clock, Firmware, frame

import biotac
from biotac.hand.hand import Hand
from biotac.hand.queue import BatchQueue
from biotac.hand.views import Latest
from biotac.link.serial_port import SerialLink
from biotac.wire import messages_gen as wire
from biotac.wire.batches import StreamDecoder
from biotac.wire.framing import encode

WAIT_S = 600.0  # only a failing test waits so long


class Timely(Firmware):
    """Tells the time that ``t_us`` gives, and may send something before it answers a PING."""

    def __init__(self, hello: Callable[..., bytes], t_us: Callable[[], int]) -> None:
        super().__init__(hello)
        self.t_us = t_us
        self.before_pong = b""

    def __call__(self, message_id: int, payload: bytes) -> bytes:
        answer = super().__call__(message_id, payload)
        if message_id != wire.GetStatus.ID:
            return self.before_pong + answer if message_id == wire.Ping.ID else answer
        facts = (
            dict.fromkeys((f.name for f in fields(wire.Status)), 0)
            | {"finger_faults": (0,) * 5}
            | {
                "req_id": payload[0],
                "t_us": self.t_us() % 2**32,
            }
        )
        return encode(wire.Status.ID, wire.Status(**facts).pack())


@pytest.fixture
def live(scripted_board, hello) -> Iterator[SimpleNamespace]:
    begin_s = time.monotonic() - 0.5
    firmware = Timely(hello, lambda: int((time.monotonic() - begin_s) * 1e6))
    board = scripted_board(firmware)
    clock = Clock()
    hand = Hand(SerialLink(board.path), host_clock=clock)
    send = lambda *frames: os.write(board._master, b"".join(frames))  # noqa: E731
    until = lambda so: hand._board.wait_for(so, WAIT_S)  # noqa: E731
    yield SimpleNamespace(hand=hand, board=board, firmware=firmware, clock=clock, send=send, until=until)
    with suppress(biotac.BiotacError):  # what a test is about, it has looked at
        hand.close()


# ---- 1: a lost board -----------------------------------------------------------------------------


def lose(live: SimpleNamespace) -> None:
    live.hand.run()
    live.send(frame(1, force_z_n=2.5))
    live.until(lambda: live.hand[0].t_us == 10_000)
    live.board.hang_up()
    live.until(lambda: not live.hand._board.connected)


def test_a_board_lost_while_threads_read_is_an_error_at_the_end_of_the_block(live) -> None:
    with pytest.raises(biotac.DeviceLostError, match="went away while it was open"), live.hand:
        lose(live)


@pytest.mark.parametrize(
    "use",
    [
        lambda hand: hand.ping(),
        lambda hand: hand["index"].force_n,
        lambda hand: hand["index"].touched,
        lambda hand: hand["index"].frame,
        lambda hand: hand.read(1.0),
        lambda hand: hand.check(),
        lambda hand: hand.run(),
        lambda hand: hand.on_batch(print),
    ],
)
def test_a_lost_board_is_an_error_at_the_next_call(live, use) -> None:
    with live.hand as hand:
        lose(live)
        assert not hand.connected and not hand.streaming
        with pytest.raises(biotac.DeviceLostError, match="went away while it was open"):
            use(hand)
    # Told once, the end of the block has nothing to add.


def test_an_error_of_the_block_itself_is_not_hidden_by_the_boards(live) -> None:
    with pytest.raises(ZeroDivisionError), live.hand:
        lose(live)
        _ = 1 // 0


def test_a_board_lost_while_it_is_pulled_is_not_connected_any_more(live) -> None:
    with live.hand as hand:
        hand.start()
        live.board.hang_up()
        for _ in range(2):
            with pytest.raises(biotac.DeviceLostError, match="went away"):
                hand.read(1.0)
        assert not hand.connected


def test_while_a_board_is_looked_for_its_last_force_is_not_given() -> None:
    latest = Latest(Clock())
    latest.update(StreamDecoder().feed(frame(3, force_z_n=1.5)), 0.0)
    assert latest["index"].force_n[2] == 1.5
    latest.is_away = lambda: True
    assert np.isnan(latest["index"].force_n).all() and latest["index"].t_us == -1
    assert biotac.FrameFlags.FAULT in latest["index"].flags
    latest.is_away = lambda: False
    assert latest["index"].force_n[2] == 1.5


# ---- 3: settings that there are not --------------------------------------------------------------


@pytest.mark.parametrize("key", ["force_gain_z_nn", "FORCE_GAIN_Z_NN", 9999])
def test_settings_that_there_are_not_are_refused(key) -> None:
    counts, tare = np.full(19, 2000, np.uint16), np.full(19, 2100.0)
    for compute in (biotac.compute, lambda _, tare, settings: biotac.per_frame(tare, settings)):
        with pytest.raises(ValueError, match=rf"settings contain '?{key}'?, expected members of biotac.Setting"):
            compute(counts, tare, {key: 1})


# ---- 4: what is wanted adds up -------------------------------------------------------------------


def test_want_after_on_touch_keeps_touch_and_the_other_way_round(live) -> None:
    touch, force = wire.QuantityFlags.TOUCH, wire.QuantityFlags.FORCE
    end = live.hand.on_touch(print)
    live.hand.want("force", rest=False)
    assert live.firmware.of(wire.Subscribe)[-1].quantities == force | touch
    live.hand.want("pac")  # TOUCH and TARE come with frames only
    live.hand.start()
    assert live.firmware.of(wire.Start)[-1].streams & wire.StreamFlags.FRAMES
    end()
    live.hand.want("force", rest=False)
    assert live.firmware.of(wire.Subscribe)[-1].quantities == force
    live.hand.on_touch(print)
    assert live.firmware.of(wire.Subscribe)[-1].quantities == force | touch


# ---- 5: age --------------------------------------------------------------------------------------


def test_age_is_of_the_samples_not_of_the_reading() -> None:
    clock, host = biotac.clock.DeviceClock(), Clock()
    host.now_s = 100.0
    latest = Latest(host, device_clock=clock)
    latest.update(StreamDecoder().feed(frame(100)), 100.0)  # its round began at 1 s
    assert latest["index"].age_s == 0.0
    for k in range(5):
        clock.round_trip(95.0 + k, 1_000_000 * k, 95.001 + k)  # device second 0 was 95
    assert latest["index"].age_s == pytest.approx(100.0 - 96.0 - biotac.clock.LAST_SAMPLE_US / 1e6, abs=0.002)
    host.now_s += 2
    assert latest["index"].age_s == pytest.approx(6.0 - biotac.clock.LAST_SAMPLE_US / 1e6, abs=0.002)
    assert latest["middle"].age_s == math.inf


def test_a_hand_asks_for_the_time_by_itself_and_keeps_the_answers_to_itself(live) -> None:
    statuses: list[wire.Status] = []
    live.hand.on_status(statuses.append)
    live.hand.run()
    live.firmware.wait_for(wire.GetStatus)
    asked = len(live.firmware.of(wire.GetStatus))
    for more in range(1, 4):
        live.clock.now_s += 0.6
        live.send(frame(more))
        live.firmware.wait_for(wire.GetStatus, asked + more)
    live.until(lambda: live.hand.clock.now().known)
    live.hand.ping()
    live.hand.ping()
    assert statuses == []
    assert live.hand.status().req_id > 0  # asked for by the user, it is his


def test_a_board_that_is_pulled_is_asked_for_the_time_too(live) -> None:
    live.hand.start()
    live.firmware.wait_for(wire.GetStatus)
    live.send(frame(1))
    batches = live.hand.batches()
    next(batches)
    live.clock.now_s += 1.0
    live.send(frame(2))
    while len(next(batches).wire) == 0:
        pass
    live.firmware.wait_for(wire.GetStatus, 2)


def test_a_fresh_read_has_nothing_of_before(live) -> None:
    live.hand.start()
    live.send(frame(1), frame(2))
    live.firmware.before_pong = frame(3)  # on its way when the question came
    threading.Timer(0.05, lambda: live.send(frame(400), frame(500))).start()
    assert live.hand.read(0.5, fresh=True)["seq"].tolist() == [400]
    live.firmware.before_pong = b""
    threading.Timer(0.05, lambda: live.send(frame(600))).start()
    assert live.hand.read(0.5)["seq"].tolist() == [500]  # not fresh: the one before ended here


# ---- 6: fingers by any key -----------------------------------------------------------------------


def test_fingers_by_numpys_integers_and_as_a_collection() -> None:
    with biotac.open("sim:press.toml?fingers=2&seconds=1") as hand:
        row = hand.read(0.1)[1]
        assert hand[row["finger"]].finger == int(row["finger"])
        assert list(hand) == ["index", "middle"] and len(hand) == 2 and bool(hand)
        assert "index" in hand and 1 in hand and np.uint8(1) in hand
        assert "thumb" not in hand and "pinky" not in hand and 4 not in hand and None not in hand
        for key in (1.0, None, 7, -1):
            with pytest.raises(KeyError, match="no finger"):
                hand[key]
        one, same = (biotac.Frame.from_row(row) for _ in range(2))
        other = biotac.Frame.from_row(hand.read(0.1)[0])
        assert one == same and one != other and one != 3 and len({one, same, other}) == 2


def test_names_of_fingers_work_in_every_command(live) -> None:
    live.hand.tare("middle")
    live.hand.set_tare("ring", [2000.0] * 19)
    live.hand.clear_calibration("little")
    live.hand.clear_map("thumb")
    live.hand.subscribe(wire.QuantityFlags.FORCE, fingers=["index", 4])
    live.hand.start(fingers="middle")
    live.hand.tare(np.uint8(3))
    told = live.firmware
    assert [m.finger for m in told.of((wire.TareNow, wire.TareSet, wire.ClearCalibration, wire.ClearMap))] == [
        *(1, 2, 3, 4, 3)
    ]
    assert [m.fingers for m in told.of((wire.Subscribe, wire.Start))] == [0b10001, 0b10]
    with pytest.raises(KeyError, match="no finger 'pinky'"):
        live.hand.tare("pinky")
    with pytest.raises(KeyError, match="no finger 'pinky'"):
        live.hand.start(fingers=["pinky"])


# ---- 12 to 14: counters, callbacks, readers ------------------------------------------------------


def test_what_a_closed_queue_has_skipped_stays_counted(live) -> None:
    queue: BatchQueue = live.hand._streams.open_queue()
    queue.bound(1)
    for seq in range(3):
        queue.put(StreamDecoder().feed(frame(seq)))
    assert live.hand.stats.batches_skipped == 2
    live.hand._streams.close_queue(queue)
    live.hand._streams.close_queue(queue)
    assert (live.hand.stats.batches_skipped, live.hand.stats.frames_skipped) == (2, 2)


def test_sys_exit_in_a_callback_comes_up_and_ends_no_thread(live) -> None:
    def leaves(batch: biotac.Batch) -> None:
        if len(batch.wire):
            raise SystemExit(3)

    live.hand.on_batch(leaves)
    live.hand.run()
    live.send(frame(1))
    live.until(lambda: live.hand._streams._callbacks._error is not None)
    with pytest.raises(biotac.CallbackError, match=r"leaves raised SystemExit: 3"):
        live.hand.check()
    live.send(frame(2))
    live.until(lambda: live.hand[0].t_us == 20_000)
    assert live.hand.streaming


def test_a_second_thread_that_reads_is_told_so(live) -> None:
    live.hand.start()
    reading, errors = threading.Event(), []
    batches = live.hand.batches()

    def first() -> None:
        live.send(frame(1))
        next(batches)
        reading.set()
        with pytest.raises(biotac.DeviceLostError, match="was closed"):
            for _ in batches:
                pass
        errors.append("first")

    thread = threading.Thread(target=first, name="first")
    thread.start()
    assert reading.wait(WAIT_S)
    with pytest.raises(biotac.InputError, match="thread 'first' is reading this hand"):
        live.hand.read(1.0)
    live.hand.close()  # beside a thread that reads
    thread.join()
    assert errors == ["first"]


def test_a_port_is_not_closed_in_the_middle_of_a_command(live, monkeypatch) -> None:
    """Else the serial port's own TypeErrors come up, of a file descriptor that is gone."""
    writes, closed, seen = threading.Event(), threading.Event(), []
    write, close = live.hand.link.write, live.hand.link.close

    def slow_write(data: bytes) -> None:
        writes.set()
        seen.append(closed.wait(0.3))
        write(data)

    def noted_close() -> None:
        closed.set()
        close()

    monkeypatch.setattr(live.hand.link, "write", slow_write)
    monkeypatch.setattr(live.hand.link, "close", noted_close)
    thread = threading.Thread(target=lambda: live.hand._board.send(wire.Ping(0)))
    thread.start()
    assert writes.wait(WAIT_S)
    live.hand.close()
    thread.join()
    assert seen == [False] and closed.is_set()
    with pytest.raises(biotac.DeviceLostError, match="was closed"):
        live.hand._board.send(wire.Ping(0))


def test_readers_may_take_turns(live) -> None:
    live.hand.start()
    live.send(frame(1), frame(2), frame(3), frame(4), frame(5))
    here = live.hand.read(0.02)["seq"].tolist()
    there: list[int] = []
    thread = threading.Thread(target=lambda: there.extend(live.hand.read(0.02)["seq"].tolist()))
    thread.start()
    thread.join()
    assert (here, there) == ([1, 2], [3, 4])


def test_close_leaves_the_backlog_of_a_slow_callback(live, monkeypatch) -> None:
    monkeypatch.setattr("biotac.hand.reader.BACKLOG_S", 0.0)
    go_on, calls = threading.Event(), []

    def slow(batch: biotac.Batch) -> None:
        if len(batch.wire):
            calls.append(batch)
            assert go_on.wait(WAIT_S)

    live.hand.on_batch(slow)
    live.hand.run()
    for seq in range(100):
        live.send(frame(seq))
        live.until(lambda seq=seq: live.hand.stats.frames > seq)
    closing = threading.Thread(target=live.hand.close)
    closing.start()
    live.hand._board.closing.wait(WAIT_S)
    while live.hand._streams._reader._give_up_s == math.inf:
        pass
    go_on.set()
    closing.join()
    assert len(calls) < 5
    stats = live.hand.stats
    assert stats.frames == 100 and stats.frames_skipped == 100 - sum(len(batch.wire) for batch in calls)
    assert stats.batches_skipped > 90


def test_what_nobody_pulls_is_bounded_and_counted(live, monkeypatch) -> None:
    """Commands read the link, too: what they find beside their answers waits for a reader who may never come."""
    monkeypatch.setattr("biotac.hand.streams.LIMIT_ROWS", 100)
    live.hand._streams._pulled = live.hand._streams._new_queue()
    live.hand.start()
    for begin in range(0, 1000, 20):
        live.send(*(frame(seq) for seq in range(begin, begin + 20)))
        live.hand.ping()
    assert live.hand._streams._pulled.rows <= 100
    rows = live.hand.read(0.5)
    stats = live.hand.stats
    assert rows["seq"][0] == stats.frames_skipped > 800
    assert stats.frames == 1000 and stats.frames_lost == 0
