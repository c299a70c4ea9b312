"""The ways of a message: queues, latest values, and the subscriptions that the board is sent."""

import math
import threading
from collections.abc import Iterator
from dataclasses import replace
from itertools import count

import numpy as np
import pytest
from live_board import WAIT_S, Firmware, Live, batch_of, frame, gaps_in, heartbeat, packed, until

import biotac
from biotac.board import stream
from biotac.board.board import Board
from biotac.board.consumers import LIMIT_ROWS, Queue
from biotac.board.reader import Consumer, Reader
from biotac.link.serial_port import SerialLink
from biotac.wire import messages_gen as wire
from biotac.wire.batches import Batch


def drained(queue: Queue) -> list[Batch]:
    return list(iter(queue.get, None))


# ---- one queue -----------------------------------------------------------------------------------


@pytest.fixture
def reader(scripted_board, hello) -> Iterator[Reader]:
    board = Board(SerialLink(scripted_board(Firmware(hello)).path))
    yield board.reader
    board.close()


@pytest.fixture
def queue(reader: Reader) -> Queue:
    return Queue(reader)


TENTH = LIMIT_ROWS // 10


def tenths(*frames: bytes) -> Batch:
    """A batch in which each of these is repeated until it is a tenth of what a queue holds."""
    batch = batch_of(*frames)
    rows = {name: np.repeat(getattr(batch, name), TENTH) for name in ("wire", "seq", "t_us")}
    return replace(batch, **rows)


def skipped(reader: Reader) -> tuple[int, int]:
    return reader.stats.batches_skipped, reader.stats.frames_skipped


def test_a_full_queue_drops_the_oldest_counts_them_and_a_gap_says_so(reader: Reader, queue: Queue) -> None:
    queue.put(batch_of(frame(0)))
    assert gaps_in(drained(queue)) == []
    for k in range(5):
        queue.put(tenths(*(frame(4 * k + n, finger=k % 2) for n in range(4))))
    first, second = drained(queue)
    assert skipped(reader) == (3, 12 * TENTH)
    assert first.seq[::TENTH].tolist() == [12, 13, 14, 15]
    (gap,) = gaps_in([first])
    assert (gap.reason, gap.frames_missed, gap.fingers) == ("slow", 12 * TENTH, 0b11)
    assert (gap.last_t_us, gap.next_t_us, gap.boot_id) == (0, 120_000, 1)
    assert gap.lost_at_ns <= gap.back_at_ns
    assert gaps_in([second]) == []


def test_gaps_of_dropped_batches_are_kept_and_come_in_their_order(queue: Queue) -> None:
    lost = [biotac.Gap("lost", k, k + 1, 0, 0, 1) for k in range(2)]
    for k in range(2):
        batch = tenths(*(frame(10 * k + n) for n in range(10)))
        batch.messages = [lost[k]]
        queue.put(batch)
    queue.put(tenths(frame(30)))
    (batch,) = drained(queue)
    assert [gap.reason for gap in gaps_in([batch])] == ["lost", "lost", "slow"]
    assert gaps_in([batch])[:2] == lost
    queue.put(batch_of(frame(31)))
    assert gaps_in(drained(queue)) == []  # told once


def test_a_batch_larger_than_the_limit_stays_while_it_is_the_newest(reader: Reader, queue: Queue) -> None:
    queue.put(tenths(*(frame(n) for n in range(12))))
    whole = queue.get()
    assert (len(whole.wire), queue.get(), skipped(reader)) == (12 * TENTH, None, (0, 0))
    queue.put_back(whole)
    queue.skip_all()
    assert skipped(reader) == (1, 12 * TENTH)


def test_messages_alone_do_not_fill_memory_either(queue: Queue) -> None:
    batch = batch_of(packed(wire.Touch(1, 1, 0, 1, 1)))
    for _ in range(LIMIT_ROWS + 50):
        queue.put(batch)
    assert len(drained(queue)) == LIMIT_ROWS


# ---- pulled queues -----------------------------------------------------------------------------------


def test_a_hand_that_nobody_pulls_from_counts_no_loss(live: Live) -> None:
    live.hand.stream()
    last = live.send_rows(LIMIT_ROWS + 1000)
    until(lambda: live.hand.stats.frames == last)
    assert live.hand.stats.batches_skipped == 0
    assert gaps_in([live.hand.read_batch(0.001)]) == []  # rows dropped before belonged to nobody


def test_an_unpaced_board_waits_for_a_slow_puller_instead() -> None:
    with biotac.open("sim:press.toml?fingers=5&seconds=60") as hand:
        pieces = [hand.read(0.5), hand.read(1.0), hand.read_batch(1000).frames]
        assert hand.ended and hand.stats.batches_skipped == 0
    assert [len(p) for p in pieces] == [250, 500, 5 * 6000 - 750]  # more than a queue holds
    for finger in range(5):
        seq = np.concatenate([p["seq"][p["finger"] == finger] for p in pieces])
        assert seq.tolist() == list(range(6000))


def test_a_fresh_read_has_nothing_of_before(live: Live) -> None:
    live.hand.stream()
    for pings, first in enumerate(range(0, 20_000, 1000), 1):
        over = threading.Event()

        def go_on(pings: int = pings, first: int = first, over: threading.Event = over) -> None:
            live.firmware.wait_for(wire.Ping, pings)
            for seq in count(first + 400):
                if over.is_set() and seq > first + 500:  # the last of them for the read that is not fresh
                    break
                live.send(frame(seq))

        live.send(frame(first + 1), frame(first + 2))
        live.firmware.before[wire.Ping] = frame(first + 3)  # on the way when the question came
        sender = threading.Thread(target=go_on)
        sender.start()
        seq = live.hand.read_batch(0.1, fresh=True).seq.tolist()
        over.set()
        sender.join()
        assert seq[0] >= first + 400 and len(seq) == 10
    assert live.hand.read(0.005)["seq"].tolist() == [seq[-1] + 1]  # not fresh: the one before ended there


def test_a_reply_comes_after_all_that_was_sent_before_it(live: Live) -> None:
    """When STOP is answered, the rows before it are there for a reader that pulls; when PING is, for views."""

    class Seen(Consumer):
        def put(self, batch: Batch) -> None:
            if len(batch.wire):
                self.seq = batch.seq[-1]

    live.hand.add(seen := Seen())
    for round_ in range(1, 100):
        live.hand.stream()
        live.firmware.before[wire.Ping] = frame(10 * round_)
        live.hand.ping()
        assert live.hand[0].frame.seq == 10 * round_
        live.firmware.before[wire.Stop] = frame(10 * round_ + 1)
        live.hand.stop()
        assert seen.seq == 10 * round_ + 1


def test_a_second_thread_that_reads_is_told_so(live: Live) -> None:
    live.hand.stream()
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


def test_readers_may_take_turns(live: Live) -> None:
    live.hand.stream()
    live.send(frame(1), frame(2), frame(3), frame(4), frame(5))
    in_main = live.hand.read(0.02)["seq"].tolist()
    in_thread: list[int] = []
    thread = threading.Thread(target=lambda: in_thread.extend(live.hand.read(0.02)["seq"].tolist()))
    thread.start()
    thread.join()
    assert (in_main, in_thread) == ([1, 2], [3, 4])


# ---- wanted streams ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "rest", "quantities", "streams"),
    [
        ((), True, int(stream.RESULTS) | 0b010000, 0b111),
        (("force", "poc", "pac"), True, 0b010011, 0b111),
        (("force",), False, 0b000010, 0b101),
        (("raw",), True, 0b010000, 0b101),
        (("pdc", "temperature"), False, 0, 0b101),
        (("torque", "touch", "status"), False, 0b100100, 0b101),
        (("pac",), False, 0, 0b110),
    ],
)
def test_names_reach_the_board_as_subscribe_and_start(live: Live, names, rest, quantities, streams) -> None:
    live.hand.stream(*names, rest=rest)
    assert live.firmware.received(wire.Subscribe)[-1].quantities == quantities
    assert live.firmware.received(wire.Start)[-1].streams == streams
    live.hand.stream("force", "pac", fingers=["index", 4])  # a running stream is changed at once
    (start,) = live.firmware.received(wire.Start)[-1:]
    assert (start.streams, start.fingers) == (0b111, 0b10001)


def test_reading_starts_what_was_chosen_last(live: Live) -> None:
    live.hand.stream("raw")
    live.hand.stop()
    live.firmware.after[wire.Start] = frame(1) + frame(2)
    live.hand.read(0.01)
    assert len(live.firmware.received(wire.Start)) == 2
    assert live.firmware.received(wire.Start)[0].streams == live.firmware.received(wire.Start)[1].streams


def test_a_rate_takes_every_nth_frame_here_and_leaves_the_recording_whole(tmp_path) -> None:
    with biotac.open("sim:press.toml?seconds=2") as hand:
        hand.record(tmp_path / "a.mcap")
        hand.stream("force", "raw", rate_hz=20)
        frames = hand.read(10)  # the source ends first, without a warning: this suite makes errors of warnings
    assert frames["seq"].tolist() == list(range(0, 200, 5))
    assert len(biotac.load(tmp_path / "a.mcap")) == 200


def test_unknown_wants_are_refused_and_change_nothing(live: Live) -> None:
    with pytest.raises(biotac.InputError, match=r"unknown name 'forces'; expected some of force, poc|results"):
        live.hand.stream("forces")
    for rate_hz in (0, -1, 101, math.nan):
        with pytest.raises(biotac.InputError, match="rate_hz is"):
            live.hand.stream("force", rate_hz=rate_hz)
    with pytest.raises(KeyError, match="no finger 'pinky'"):
        live.hand.stream(fingers=["pinky"])
    assert live.firmware.received((wire.Subscribe, wire.Start)) == [] and not live.hand.streaming


@pytest.mark.parametrize(("pace", "keepalive_ms"), [(0, 0), (0.5, 1000), (1, 1000), (4, 4000), (1000, 0xFFFF)])
def test_the_keep_alive_is_a_second_of_this_computers(live: Live, pace, keepalive_ms) -> None:
    live.hand.link.pace = pace
    live.hand.stream()
    assert live.firmware.received(wire.Start)[-1].keepalive_ms == keepalive_ms


# ---- the latest of each finger -------------------------------------------------------------------


def test_the_latest_is_by_name_and_number_and_only_of_fingers_that_are_there(scripted_board, hello) -> None:
    board = scripted_board(firmware := Firmware(hello, fingers_present=0b1011))
    live = Live(board, firmware, max_age_s=math.inf)  # however old values may be
    hand = live.hand
    firmware.facts["fingers_present"] = 0b11111
    assert hand["index"].age_s == math.inf and hand["index"].stale.startswith("nothing has arrived")
    nothing = hand["index"].frame
    assert np.isnan([*nothing.force_n, nothing.torsion_nmm, *nothing.tare, nothing.pdc_tare]).all()
    assert (nothing.pdc, nothing.slip_level) == (wire.INVALID_COUNT, 255)
    assert biotac.FrameFlags.UNTARED in hand["index"].flags and hand["index"].t_us == -1
    for key in ("thumb", 4, "ring"):
        with pytest.raises(KeyError, match=rf"no sensor answers as '?{key}'?; those that do: 'index', 'middle', 'li"):
            hand[key]
    for key in ("pinky", 5, -1, 1.0, None):
        with pytest.raises(KeyError, match="no finger"):
            hand[key]
    hand.stream()
    hand.status()  # which says that the thumb answers now
    live.send(frame(7, finger=1, force_z_n=1.25), frame(8), frame(8, finger=1, force_z_n=2.5), frame(8, finger=4))
    until(lambda: hand["thumb"].t_us == 80_000)
    assert hand["middle"].force_n.tolist() == hand[1].force_n.tolist() == [0, 0, 2.5]
    assert hand["middle"].torsion_nmm == hand["middle"].frame.torsion_nmm == 0.25
    assert (hand["middle"].frame.seq, hand["middle"].stale, hand["ring"].age_s) == (8, "", math.inf)
    hand.close()


def test_fingers_may_have_other_names(scripted_board, hello) -> None:
    board = scripted_board(Firmware(hello))
    with biotac.open(board.path, fingers={"thumb": 0, "palm": 3}) as hand:
        assert (hand["thumb"].finger, hand["palm"].finger, hand[1].name) == (0, 3, "1")
        assert list(hand) == ["thumb", "1", "2", "palm", "4"]
        with pytest.raises(KeyError, match="'palm'"):
            hand["index"]
    for bad in ({"a": 5}, {"a": "b"}, {"a": 1, "b": 1}):
        with pytest.raises(biotac.InputError, match="fingers: 'a'"):
            biotac.open(board.path, fingers=bad)


SHOWN = [(2,), (0, 1), (3, 3), (), (1,), (0, 1), (0,), *[(1, 0)] * 40]  # fingers of one batch after another


def test_the_latest_of_each_finger_is_found_in_whichever_batch_has_it(live: Live) -> None:
    live.hand.stream()
    for seq, fingers in enumerate(SHOWN):
        live.send(*(frame(seq, finger) for finger in fingers), heartbeat(seq, 4))
    until(lambda: live.hand[4].frame.seq == len(SHOWN) - 1)
    for finger in range(4):
        assert live.hand[finger].frame.seq == max(seq for seq, fingers in enumerate(SHOWN) if finger in fingers)


def test_a_heartbeat_replaces_the_former_force_by_nothing(live: Live) -> None:
    live.hand.stream("force", rest=False)
    live.send(frame(1, force_z_n=2.0), heartbeat(5, frames=4), frame(3))
    until(lambda: live.hand.stats.frames == 2)
    live.hand.ping()  # when it is answered, views have them
    view = live.hand["index"]
    assert np.isnan(view.force_n).all() and biotac.FrameFlags.NOT_ASKED in view.flags and not view.touched
    assert (view.t_us, view.pdc) == (50_000, 2000)  # the later in device time


@pytest.mark.parametrize("live", [{"max_age_s": 29.0}], indirect=True)
def test_values_older_than_the_program_wants_are_not_shown(live: Live) -> None:
    live.start_clock()
    live.hand.stream()
    now_us = live.firmware.now_us()
    live.send(frame(1, t_us=now_us, force_z_n=2.0), frame(1, finger=1, t_us=now_us - 30_000_000))
    until(lambda: live.hand["middle"].age_s < math.inf)
    assert live.hand["index"].age_s + 29 < live.hand["middle"].age_s  # by the samples, not by when they were read
    assert "at most 29 s is allowed" in live.hand["middle"].stale
    assert np.isnan(live.hand["middle"].force_n).all() and live.hand["middle"].t_us == -1
    with pytest.raises(TimeoutError, match=r"no new frame of finger 'middle' in 0 s: .* old, at most 29 s"):
        live.hand["middle"].next_frame(0)


@pytest.mark.parametrize("finger", [5, 255])
def test_a_finger_that_only_the_board_knows_ends_nothing(live: Live, finger: int) -> None:
    live.firmware.facts["fingers_present"] = 0xFF
    live.hand.status()
    with pytest.raises(TimeoutError):
        live.hand.next_round(timeout_s=0)
    live.send(frame(1, finger=finger), frame(1, force_z_n=2.0), heartbeat(40, finger=finger))
    until(lambda: live.hand["index"].t_us > 0)
    assert live.hand["index"].force_n[2] == 2.0
    with pytest.raises(KeyError, match="no finger"):
        live.hand[finger]


def test_next_frame_waits_for_one_that_comes_after_the_call(live: Live) -> None:
    live.hand.stream()
    live.send(frame(1), frame(1, finger=1))
    until(lambda: live.hand[0].t_us == 10_000)
    got: list[biotac.Frame] = []
    thread = threading.Thread(target=lambda: got.append(live.hand[0].next_frame(WAIT_S)))
    thread.start()
    for seq in range(2, 10):
        live.send(frame(seq, finger=1))  # the other finger's end no wait
    for seq in count(10):  # until it waits
        live.send(frame(seq))
        if not thread.is_alive():
            break
    thread.join()
    assert got[0].seq >= 10
