"""Callbacks: their arguments and order, that they keep nobody waiting, and the fate of their errors."""

import logging
import threading
import time

import pytest
from live_board import WAIT_S, Live, frame, gaps_in, packed, until

import biotac
from biotac.board.consumers import LIMIT_ROWS, DeferredErrors
from biotac.wire import messages_gen as wire
from biotac.wire.batches import Batch


def test_callbacks_get_everything_in_order_until_they_unsubscribe(live: Live) -> None:
    seen: list[object] = []
    stop = live.hand.on_batch(lambda batch: seen.extend(batch.seq.tolist()))
    live.hand.on_touch(lambda touch: seen.append(f"touch {touch.finger}"))
    live.hand.on_status(lambda status: seen.append(f"status {status.req_id}"))
    live.hand.stream()
    assert [s.quantities & wire.QuantityFlags.TOUCH for s in live.firmware.received(wire.Subscribe)] == [32]
    touch = wire.Touch(3, live.firmware.now_us(), 2, 1, 500)
    live.send(frame(0), frame(1), packed(touch), frame(2), packed(live.firmware.status()))
    until(lambda: len(seen) == 5)
    stop()
    stop()
    live.send(frame(3), packed(touch))
    until(lambda: len(seen) == 6)
    assert seen == [0, 1, 2, "touch 2", "status 0", "touch 2"]  # the watch's questions are not the program's


@pytest.mark.parametrize("live", [{"max_age_s": 20.0}], indirect=True)
def test_events_come_with_slips_apart_and_old_ones_do_not(live: Live) -> None:
    seen: list[str] = []
    live.start_clock()
    live.hand.on_event(lambda event: seen.append(biotac.EventKind(event.kind).name))
    stop = live.hand.on_slip(lambda event: seen.append(f"slip of {event.finger}, {event.peak_count}"))
    live.hand.stream()
    assert live.firmware.received(wire.Subscribe)[-1].quantities & wire.QuantityFlags.EVENTS
    assert len(live.firmware.received(wire.Subscribe)) == 1
    now_us = live.firmware.now_us()
    touch = wire.Event(3, now_us, 2, 1, biotac.EventKind.TOUCH, 1, 30_000, 5000, wire.INVALID_COUNT, 255)
    slip = wire.Event(5, now_us, 2, 28, biotac.EventKind.SLIP, 2, 50_000, 2**32 - 1, 120, 255)
    old = wire.Event(5, now_us - 30_000_000, 3, 28, biotac.EventKind.SLIP, 2, 50_000, 2**32 - 1, 120, 255)
    live.send(*(packed(event) for event in (old, touch, slip)))
    until(lambda: len(seen) == 3)
    stop()
    assert seen == ["TOUCH", "SLIP", "slip of 2, 120"]


def test_what_callbacks_wait_for_is_added_to_what_was_chosen(live: Live) -> None:
    touch, force, firmware = wire.QuantityFlags.TOUCH, wire.QuantityFlags.FORCE, live.firmware
    live.hand.on_touch(print)
    live.hand.stream("force", rest=False)
    assert firmware.received(wire.Subscribe)[-1].quantities == force | touch
    live.hand.stream("pac")  # TOUCH comes with frames only
    assert firmware.received(wire.Start)[-1].streams & wire.StreamFlags.FRAMES
    live.hand.stream("force", rest=False)
    live.hand.on_event(print)  # a running stream is changed at once
    assert firmware.received(wire.Subscribe)[-1].quantities == force | touch | wire.QuantityFlags.EVENTS


def streaming_to_a_slow_callback(live: Live) -> tuple[threading.Event, list[Batch]]:
    """An event that the callback waits for, and the batches it was called with."""
    resume, calls = threading.Event(), []

    def slow(batch: Batch) -> None:
        calls.append(batch)
        assert resume.wait(WAIT_S)

    live.hand.on_batch(slow)
    live.hand.stream()
    return resume, calls


def test_slow_consumers_lose_the_oldest_and_keep_neither_link_nor_commands_waiting(live: Live) -> None:
    resume, calls = streaming_to_a_slow_callback(live)
    next(batches := live.hand.batches(every_s=0.01))  # beside a callback, its queue begins here
    live.send(frame(0))
    pulled = [next(b for b in batches if len(b.wire))]
    until(lambda: calls)
    last = live.send_rows(LIMIT_ROWS + 1000)  # megabytes, much more than a pty holds
    until(lambda: live.hand.stats.frames == last + 1)
    live.hand.ping()  # read after the last one was handed on
    assert live.hand[0].t_us == 10_000 * last
    resume.set()
    live.send(frame(last + 1))  # alone it fits, however large the batches before were
    until(lambda: any(last + 1 in batch.seq for batch in calls))
    while last + 1 not in pulled[-1].seq:
        pulled.append(next(b for b in batches if len(b.wire)))
    stats, skipped = live.hand.stats, 0
    for got in (calls, pulled):
        gaps, missed = gaps_in(got), last + 2 - sum(len(b.wire) for b in got)
        assert missed == sum(gap.frames_missed for gap in gaps) >= 1000 - len(got[-1].wire)
        assert {gap.reason for gap in gaps} == {"slow"}
        skipped += missed
    assert stats.frames_skipped == skipped and stats.batches_skipped > 0 and stats.frames_lost == 0


def test_close_leaves_the_backlog_of_a_slow_callback(live: Live) -> None:
    """After a second, in which this one is called three times at most, and once more while it ends."""
    resume, calls = streaming_to_a_slow_callback(live)
    live.hand.on_batch(lambda batch: time.sleep(0.4))
    for seq in range(100):
        live.send(frame(seq))
        until(lambda seq=seq: live.hand.stats.frames > seq)
    live.hand.ping()
    resume.set()
    live.hand.close()
    stats = live.hand.stats
    assert len(calls) <= 4 and stats.frames == 100
    assert stats.frames_skipped == 100 - sum(len(b.wire) for b in calls) and stats.batches_skipped > 90


def test_a_callback_may_give_commands_stop_and_close(live: Live) -> None:
    live.hand.on_batch(lambda batch: live.hand.tare(0) if 0 in batch.seq else None)
    live.hand.on_batch(lambda batch: live.hand.stop() if 1 in batch.seq else None)
    live.hand.on_batch(lambda batch: live.hand.close() if 2 in batch.seq else None)
    live.hand.stream()
    live.send(frame(0))
    live.firmware.wait_for(wire.TareNow)
    live.send(frame(1))
    live.firmware.wait_for(wire.Stop, 2)  # after the handshake's
    live.send(frame(2))
    until(lambda: live.hand.closed)
    live.hand.close()  # nothing was wrong


# ---- errors of callbacks -------------------------------------------------------------------------

CALLS = {
    "force_n": lambda live, path: live.hand[0].force_n,
    "stale": lambda live, path: live.hand[0].stale,
    "ping": lambda live, path: live.hand.ping(),
    "hold": lambda live, path: live.hand.hold(0),
    "stream": lambda live, path: live.hand.stream(),
    "stop": lambda live, path: live.hand.stop(),
    "record": lambda live, path: live.hand.record(path / "a.mcap"),
    "streaming": lambda live, path: live.hand.streaming,
    "stats": lambda live, path: live.hand.stats,
    "check": lambda live, path: live.hand.check(),
    "read": lambda live, path: live.hand.read(0.01),
    "on_batch": lambda live, path: live.hand.on_batch(print),
    "close": lambda live, path: live.hand.close(),
}


def not_my_day(batch: Batch) -> None:
    if len(batch.wire):
        raise ValueError("not my day")


@pytest.mark.parametrize("call", CALLS)
def test_what_a_callback_raises_is_raised_by_the_next_call_of_any_kind(live: Live, call, tmp_path, caplog) -> None:
    seen: list[int] = []
    live.hand.on_batch(not_my_day)
    live.hand.on_batch(lambda batch: seen.extend(batch.seq.tolist()))
    live.hand.stream()
    view = live.hand[0]
    live.send(frame(0))
    until(lambda: seen == [0])
    with pytest.raises(biotac.CallbackError, match=r"not_my_day raised ValueError: not my day; fix it") as caught:
        CALLS[call](live, tmp_path)
    assert isinstance(caught.value.__cause__, ValueError)
    (record,) = [r for r in caplog.records if r.levelno == logging.ERROR]
    assert record.name == "biotac" and record.exc_info[1] is caught.value.__cause__
    if call != "close":
        view.stale, live.hand.check()  # once is enough
        live.send(frame(1))  # it stays subscribed, and so do the others
        until(lambda: seen == [0, 1])
        with pytest.raises(biotac.CallbackError, match="not my day"):
            live.hand.close()
    live.hand.close()


def test_what_the_body_of_a_grasp_raises_goes_before_what_a_callback_raised(live: Live, caplog) -> None:
    seen: list[int] = []
    live.hand.on_batch(not_my_day)
    live.hand.on_batch(lambda batch: seen.extend(batch.seq.tolist()))  # is called after it
    live.hand.stream()
    with pytest.raises(ZeroDivisionError), live.hand.grasp(0):
        live.send(frame(0))
        until(lambda: seen)
        _ = 1 / 0
    live.firmware.wait_for(wire.Release)
    with pytest.raises(biotac.CallbackError, match="not my day"):
        live.hand.check()


def test_sys_exit_in_a_callback_is_raised_and_ends_no_thread(live: Live) -> None:
    def leaves(batch: Batch) -> None:
        if len(batch.wire):
            raise SystemExit(3)

    seen: list[int] = []
    live.hand.on_batch(leaves)
    live.hand.on_batch(lambda batch: seen.extend(batch.seq.tolist()))  # is called after it
    live.hand.stream()
    for seq in range(1, 3):
        live.send(frame(seq))
        until(lambda: seq in seen)  # noqa: B023 - called at once
        with pytest.raises(biotac.CallbackError, match=r"leaves raised SystemExit: 3"):
            live.hand.check()
    assert live.hand[0].t_us == 20_000 and live.hand.streaming


def test_several_errors_are_one_that_counts_the_others() -> None:
    troubles = DeferredErrors()
    for text in "abc":
        troubles.add(biotac.CallbackError(text))
    with pytest.raises(biotac.CallbackError, match=r"^a, and 2 more error\(s\) since; fix it$"):
        troubles.report()
    troubles.report()


def test_a_callbacks_commands_do_not_raise_what_callbacks_raised(live: Live) -> None:
    """The program is told, not the callbacks: their errors would grow by one another's."""
    done = threading.Event()

    def commands(batch: Batch) -> None:
        live.hand.ping()
        live.hand.check()
        if 9 in batch.seq:
            done.set()
        raise ValueError("again")

    live.hand.on_batch(commands)
    live.hand.stream()
    for seq in range(10):
        live.send(frame(seq))
    assert done.wait(WAIT_S)
    with pytest.raises(biotac.CallbackError) as caught:
        live.hand.close()
    assert str(caught.value).count("raised ValueError") == 1
