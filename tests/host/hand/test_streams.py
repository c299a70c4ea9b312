"""Reading in the background: the board loses nothing, slow consumers lose the oldest, callbacks may fail."""

from __future__ import annotations

import math
import os
import threading
import time
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from live_board import Clock, Firmware, frame

import biotac
from biotac.hand import queue as queue_module
from biotac.hand.hand import Hand
from biotac.hand.views import Latest
from biotac.link.serial_port import SerialLink
from biotac.wire import messages_gen as wire
from biotac.wire.batches import StreamDecoder

WAIT_S = 600.0  # only a failing test waits so long


class Live:
    """A hand on a scripted board."""

    def __init__(self, board, firmware: Firmware, clock: Clock) -> None:
        self.board = board
        self.firmware = firmware
        self.clock = clock
        self.hand = Hand(SerialLink(board.path), host_clock=clock)

    def send(self, *frames: bytes) -> None:
        os.write(self.board._master, b"".join(frames))

    def until(self, so: Callable[[], bool]) -> None:
        """Woken by whatever arrives."""
        assert self.hand._board.wait_for(so, WAIT_S)


@pytest.fixture
def live(scripted_board, hello) -> Iterator[Live]:
    firmware = Firmware(hello)
    live = Live(scripted_board(firmware), firmware, Clock())
    yield live
    live.hand.close()


def batch_of(*frames: bytes) -> biotac.wire.batches.Batch:
    return StreamDecoder().feed(b"".join(frames))


def test_a_full_queue_lets_the_oldest_go_and_counts_them() -> None:
    queue = queue_module.BatchQueue()
    queue.bound(10)
    for k in range(5):
        queue.put(batch_of(*(frame(4 * k + n) for n in range(4))))
    assert (queue.batches_skipped, queue.frames_skipped, queue.rows) == (3, 12, 8)
    assert queue.take().seq.tolist() == [12, 13, 14, 15]


def test_a_batch_larger_than_the_limit_is_kept_as_long_as_it_is_the_newest() -> None:
    queue = queue_module.BatchQueue()
    queue.bound(2)
    queue.put(batch_of(*(frame(n) for n in range(4))))
    assert len(queue.take().wire) == 4
    assert (queue.take(), queue.batches_skipped) == (None, 0)


def test_the_latest_of_a_finger_is_there_by_name_number_and_not_otherwise(live: Live) -> None:
    hand = live.hand
    assert hand["index"].age_s == math.inf
    assert np.isnan(hand["index"].force_n).all() and np.isnan(hand["index"].torsion_nmm)
    assert biotac.FrameFlags.UNTARED in hand["index"].flags and hand["index"].t_us == -1
    hand.run()
    live.send(frame(7, finger=1, force_z_n=1.25), frame(8, finger=0), frame(8, finger=1, force_z_n=2.5))
    live.until(lambda: hand["middle"].t_us == 80_000)
    assert hand["middle"].force_n.tolist() == hand[1].force_n.tolist() == [0, 0, 2.5]
    assert hand["middle"].counts.tolist() == [2000] * 19
    assert hand["middle"].torsion_nmm == hand["middle"].frame.torsion_nmm == 0.25
    assert hand["middle"].frame.seq == 8
    assert hand["thumb"].age_s == math.inf
    live.clock.now_s += 0.75
    assert hand["middle"].age_s == pytest.approx(0.75)
    with pytest.raises(KeyError, match=r"no finger 'pinky'; expected one of 'index', 'middle'.*or 0 to 4"):
        hand["pinky"]
    with pytest.raises(KeyError, match="no finger 5"):
        hand[5]


def test_fingers_may_have_other_names(scripted_board, hello) -> None:
    board = scripted_board(Firmware(hello))
    with biotac.open(board.path, fingers={"thumb": 0, "palm": 3}) as hand:
        assert (hand["thumb"].finger, hand["palm"].finger, hand[1].name) == (0, 3, "1")
        with pytest.raises(KeyError, match="'palm'"):
            hand["index"]
    for bad in ({"a": 5}, {"a": "b"}, {"a": 1, "b": 1}):
        with pytest.raises(biotac.InputError, match="fingers: 'a'"):
            biotac.open(board.path, fingers=bad)


def test_a_heartbeat_makes_the_former_force_invalid_instead_of_stale() -> None:
    with biotac.open("sim:press.toml?seconds=4.5") as hand:
        hand.want("force", rest=False)
        was_touched = False
        for batch in hand.batches():  # of any size: the touch may begin and end within one
            was_touched |= bool((batch.wire["flags"] & biotac.FrameFlags.CONTACT).any())
        view = hand["index"]
    assert was_touched and not view.touched
    assert np.isnan(view.force_n).all() and biotac.FrameFlags.NOT_ASKED in view.flags
    assert view.t_us > 4_000_000 and 0 < view.pdc < 4096


def test_callbacks_get_everything_until_they_unsubscribe(live: Live) -> None:
    seen: list[int] = []
    kinds: list[str] = []
    stop = live.hand.on_batch(lambda batch: seen.extend(batch.seq.tolist()))
    live.hand.on_touch(lambda touch: kinds.append(f"touch {touch.finger}"))
    live.hand.on_status(lambda status: kinds.append("status"))
    live.hand.run()
    assert [s.quantities & wire.QuantityFlags.TOUCH for s in live.firmware.of(wire.Subscribe)] == [32]
    touch = wire.Touch(3, 30_000, 2, 1, 500)
    live.send(frame(0), frame(1), biotac.wire.framing.encode(touch.ID, touch.pack()), frame(2))
    live.until(lambda: live.hand[0].t_us == 20_000)
    live.hand.ping()  # behind it
    live.hand.ping()  # and everything before is dispatched when the next is read
    stop()
    stop()
    live.send(frame(3))
    live.until(lambda: live.hand[0].t_us == 30_000)
    live.hand.close()
    assert seen == [0, 1, 2]
    assert kinds == ["touch 2"]


def test_events_are_called_with_slips_apart(live: Live) -> None:
    seen: list[str] = []
    live.hand.on_event(lambda event: seen.append(biotac.EventKind(event.kind).name))
    stop = live.hand.on_slip(lambda event: seen.append(f"slip of {event.finger}, {event.peak_count}"))
    live.hand.run()
    asked = live.firmware.of(wire.Subscribe)
    assert len(asked) == 1 and asked[0].quantities & wire.QuantityFlags.EVENTS
    touch = wire.Event(3, 30_000, 2, 1, biotac.EventKind.TOUCH, 1, 30_000, 5000, wire.INVALID_COUNT)
    slip = wire.Event(5, 52_000, 2, 28, biotac.EventKind.SLIP, 2, 50_000, 2**32 - 1, 120)
    live.send(*(biotac.wire.framing.encode(event.ID, event.pack()) for event in (touch, slip)), frame(0))
    live.until(lambda: len(seen) == 3)
    stop()
    assert seen == ["TOUCH", "SLIP", "slip of 2, 120"]


def test_bands_are_streamed_to_who_wants_them(live: Live) -> None:
    seen: list[wire.Bands] = []
    live.hand.run()
    assert not live.firmware.of(wire.Start)[-1].streams & wire.StreamFlags.BANDS
    live.hand.on_bands(seen.append)
    assert live.firmware.of(wire.Start)[-1].streams & wire.StreamFlags.BANDS
    bands = wire.Bands(3, 30_227, 2, 22, (1, 2, 3, 4, 5, 2**32 - 2))
    live.send(biotac.wire.framing.encode(bands.ID, bands.pack()), frame(0))
    live.until(lambda: len(seen) == 1)
    assert seen == [bands]


def test_what_a_callback_raises_comes_up_at_the_next_call_and_kills_nobody(live: Live) -> None:
    seen: list[int] = []

    def broken(batch) -> None:
        if len(batch.wire):
            raise ValueError("not my day")

    live.hand.on_batch(broken)
    live.hand.on_batch(lambda batch: seen.extend(batch.seq.tolist()))
    live.hand.run()
    live.send(frame(0))
    live.until(lambda: live.hand[0].t_us == 0)
    live.hand.ping()
    live.hand.ping()
    with pytest.raises(biotac.CallbackError, match=r"broken raised ValueError: not my day; fix it") as caught:
        live.hand.check()
    assert isinstance(caught.value.__cause__, ValueError)
    live.hand.check()  # once is enough
    live.send(frame(1))
    live.until(lambda: live.hand[0].t_us == 10_000)
    live.hand.ping()
    live.hand.ping()
    with pytest.raises(biotac.CallbackError, match="not my day"):
        live.hand.close()
    assert seen == [0, 1]
    live.hand.close()


def test_a_callback_that_hangs_does_not_keep_the_link_waiting(live: Live) -> None:
    hangs, go_on = threading.Event(), threading.Event()

    def slow(batch) -> None:
        if len(batch.wire):
            hangs.set()
            assert go_on.wait(WAIT_S)

    live.hand.on_batch(slow)
    live.hand.run()
    live.send(frame(0))
    assert hangs.wait(WAIT_S)
    for first in range(1, 2001, 20):  # 400 kB, much more than a pty holds
        live.send(*(frame(seq) for seq in range(first, first + 20)))
    live.until(lambda: live.hand.stats.frames == 2001)
    assert live.hand[0].t_us == 20_000_000
    assert live.hand.ping() is None  # commands go through as well
    go_on.set()


def test_a_callback_may_give_commands(live: Live) -> None:
    done = threading.Event()

    def tares(batch) -> None:
        if len(batch.wire) and not done.is_set():
            live.hand.tare(0)
            done.set()

    live.hand.on_batch(tares)
    live.hand.run()
    live.send(frame(0))
    assert done.wait(WAIT_S)
    assert [m.finger for m in live.firmware.of(wire.TareNow)] == [0]


def test_a_slow_puller_loses_the_oldest_on_this_side_only(live: Live) -> None:
    live.hand._streams._pulled.bound(100)
    live.hand.run(queue=True)
    for seq in range(1000):
        live.send(frame(seq))
    live.until(lambda: live.hand.stats.frames == 1000)
    batches = live.hand.batches()
    first = next(batch for batch in batches if len(batch.wire))
    got = [first]
    while got[-1].seq[-1] != 999:
        got.append(next(b for b in batches if len(b.wire)))
    frames = sum(len(b.wire) for b in got)
    stats = live.hand.stats
    assert 0 < frames <= max(100, len(got[-1].wire))  # the newest stays, however much came at once
    assert stats.frames_skipped == 1000 - frames and stats.batches_skipped > 0
    assert stats.frames_lost == 0


def test_a_simulated_board_waits_for_a_slow_puller_instead() -> None:
    with biotac.open("sim:press.toml?fingers=5&seconds=60") as hand:
        hand.run(queue=True)
        frames = hand.read_batch(1000).frames
    with biotac.open("sim:press.toml?fingers=5&seconds=60") as hand:
        pulled = hand.read_batch(1000).frames
    assert len(frames) == 5 * 6000  # more than a queue holds
    assert frames.tobytes() == pulled.tobytes()
    assert hand.stats.batches_skipped == 0


def test_read_in_pieces_gives_every_row_with_threads_too() -> None:
    with biotac.open("sim:press.toml?fingers=2&seconds=3") as hand:
        hand.run(queue=True)
        pieces = [hand.read(0.5), hand.read(1.0), hand.read(10.0)]
        assert hand.ended
    assert [len(p) for p in pieces] == [100, 200, 300]
    for finger in range(2):
        seq = np.concatenate([p["seq"][p["finger"] == finger] for p in pieces])
        assert seq.tolist() == list(range(300))


def test_commands_of_many_threads_do_not_mix() -> None:
    with biotac.open("sim:drift.toml?seconds=60") as hand:
        hand.run()
        asked = list(wire.Setting)
        alone = {s: hand.setting(s) for s in asked}
        answers: list[tuple[wire.Setting, int]] = []
        threads = [
            threading.Thread(target=lambda: answers.extend((s, hand.setting(s)) for s in asked)) for _ in range(4)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert len(answers) == 4 * len(asked)
    assert all(alone[setting] == value for setting, value in answers)


def test_a_reading_thread_that_gives_a_command_reads_the_reply_that_another_waits_for() -> None:
    """As at the end of a simulated source, which the thread that reads asks about while others command."""
    with biotac.open("sim:drift.toml?seconds=60") as hand:
        board, here = hand._board, threading.current_thread()
        board.is_read_here, board.is_pulled = (lambda: threading.current_thread() is here), False  # as ``run`` does
        answers: list[int] = []
        other = threading.Thread(target=lambda: answers.append(hand.setting(wire.Setting.STATUS_PERIOD_MS)))
        other.start()
        while not board.awaiting:
            time.sleep(0.001)
        hand.ping()
        other.join()
    assert answers == [1000]


def test_start_carries_the_keep_alive_and_pings_come_in_time(live: Live) -> None:
    live.hand.start()
    assert live.firmware.of(wire.Start)[-1].keepalive_ms == 0  # pulled: nobody would ping
    live.hand.run()  # streaming already: told again
    assert live.firmware.of(wire.Start)[-1].keepalive_ms == 1000
    signs = (wire.Ping, wire.GetStatus)  # some of them ask for the time
    live.hand.ping()  # all that was sent until now is heard
    before = len(live.firmware.of(signs))
    for more in range(1, 6):
        live.send(frame(more))  # so that nothing is silent, and the reader has a turn
        live.clock.now_s += 0.34
        live.firmware.wait_for(signs, before + more)
    live.hand.stop()
    assert len(live.firmware.of(signs)) == before + 5
    assert len(live.firmware.of(wire.GetStatus)) >= 4


def test_a_board_whose_time_waits_has_no_keep_alive_and_a_fast_one_a_longer() -> None:
    with biotac.open("sim:drift.toml?seconds=1") as hand:
        hand.run()
        assert hand._streams._keepalive.timeout_ms(live=True) == 0
    with biotac.open("sim:drift.toml?seconds=1&pace=4") as hand:
        hand.run()
        assert hand._streams._keepalive.timeout_ms(live=True) == 4000


def test_silence_ends_the_reader_in_words(live: Live) -> None:
    live.hand.run(queue=True)
    live.hand.ping()  # all that it was asked is answered: no late answer breaks the silence
    live.hand.link.patience = 1.0
    live.clock.now_s += 3.1
    with pytest.raises(biotac.DeviceLostError, match=r"silent for 3 s.*check the cable"):
        for _ in live.hand.batches():
            pass
    with pytest.raises(biotac.DeviceLostError):
        live.hand.ping()


def test_a_recording_gets_every_chunk_while_threads_read(tmp_path) -> None:
    with biotac.open("sim:press.toml?fingers=2&seconds=3") as hand:
        hand.record(tmp_path / "a.mcap")
        ended = threading.Event()
        hand.on_batch(lambda batch: None)
        hand.run()
        assert hand._board.wait_for(lambda: hand.ended, WAIT_S)
        ended.set()
    recording = biotac.Recording(tmp_path / "a.mcap")
    assert recording.problems == []
    assert len(recording.frames) == 600


def test_a_full_disk_ends_the_recording_and_is_told_not_the_reading(live: Live, tmp_path, monkeypatch) -> None:
    recorder = type("Full", (), {"closed": True, "path": tmp_path, "close": lambda self: None})()

    def full(chunk: bytes) -> None:
        raise OSError(28, "No space left on device")

    recorder.write, recorder.write_gap = full, full
    live.hand.run()
    live.hand._recorded.to(recorder)
    live.send(frame(0), frame(1))
    live.until(lambda: live.hand[0].t_us == 10_000)
    with pytest.raises(OSError, match="No space left"):
        live.hand.check()


@pytest.mark.parametrize(
    ("names", "rest", "quantities", "streams"),
    [
        (("force", "poc", "pac"), True, 0b010011, 0b111),
        (("force",), False, 0b000010, 0b101),
        (("raw",), True, 0b010000, 0b101),
        (("pdc", "temperature"), False, 0, 0b101),
        (("torque", "sigma", "touch", "status"), False, 0b101100, 0b101),
        (("pac",), False, 0, 0b110),
    ],
)
def test_wants_reach_the_board_as_subscribe_and_start(live: Live, names, rest, quantities, streams) -> None:
    live.hand.want(*names, rest=rest)
    live.hand.start()
    assert live.firmware.of(wire.Subscribe)[-1].quantities == quantities
    assert live.firmware.of(wire.Start)[-1].streams == streams
    live.hand.want("force", "pac")
    assert live.firmware.of(wire.Start)[-1].streams == 0b111  # a running stream is changed at once


def test_a_rate_takes_every_nth_frame_here_and_leaves_the_recording_whole(tmp_path) -> None:
    with biotac.open("sim:press.toml?seconds=2") as hand:
        hand.record(tmp_path / "a.mcap")
        hand.want("force", "raw", rate_hz=20)
        frames = hand.read(10)
    assert frames["seq"].tolist() == list(range(0, 200, 5))
    assert len(biotac.load(tmp_path / "a.mcap")) == 200


def test_unknown_wants_are_refused(live: Live) -> None:
    with pytest.raises(biotac.InputError, match=r"unknown name 'forces'; expected some of force, poc"):
        live.hand.want("forces")
    for rate_hz in (0, -1, 101, math.nan):
        with pytest.raises(biotac.InputError, match="rate_hz is"):
            live.hand.want("force", rate_hz=rate_hz)
    with pytest.raises(biotac.InputError, match="no name was given"):
        live.hand.want()
    assert live.firmware.of(wire.Subscribe) == []


def test_nothing_live_begins_after_close(live: Live) -> None:
    live.hand.close()
    with pytest.raises(biotac.DeviceLostError, match="was closed"):
        live.hand.run()


def test_the_latest_of_each_finger_is_found_in_whichever_batch_has_it() -> None:
    latest = Latest(Clock())
    batches = [batch_of(*(frame(seq, finger=finger) for finger in fingers)) for seq, fingers in enumerate(SHOWN)]
    assert batches[1].fingers == 0b11 and batches[3].fingers == -1
    for k, batch in enumerate(batches):
        latest.update(batch, float(k))
    for finger in (0, 1, 2, 3, 200):
        seq = max(seq for seq, fingers in enumerate(SHOWN) if finger in fingers)
        assert latest.row(finger)["seq"][0] == seq


#: Fingers of one batch after another; 200 has no bit in a mask.
SHOWN = [(2,), (0, 1), (3, 3), (200, 0), (), (1,), (0, 1), (0,), *[(1, 0)] * 40]


def test_a_program_that_was_stopped_reads_before_it_says_silent(live: Live) -> None:
    """SIGSTOP, or a laptop's lid: the clock has gone on, and what the board said meanwhile waits to be read."""
    live.hand.start()
    assert live.hand._board.read(WAIT_S)  # what time it is, which start() asks
    live.hand.link.patience = 1.0
    live.clock.now_s += 10.0
    live.send(frame(1))
    live.hand._streams.read(0.0)
    assert live.hand.stats.frames == 1
    live.clock.now_s += 10.0
    with pytest.raises(biotac.DeviceLostError, match="silent for 3 s"):
        live.hand._streams.read(0.0)
