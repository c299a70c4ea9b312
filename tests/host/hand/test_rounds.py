"""Round by round: all fingers, every event once, and nothing old, also after a board goes away and comes back."""

import threading

import pytest
from live_board import WAIT_S, Firmware, Live, frame, gaps_of, packed, until

import biotac
from biotac.wire import messages_gen as wire


def slip_at(t_us: int) -> bytes:
    return packed(wire.Event(0, t_us, 0, 0, wire.EventKind.SLIP, 0, t_us, 0, 100, wire.Trust.ACT))


@pytest.mark.parametrize("waiting", [False, True])
def test_the_next_round_after_a_reboot_comes_at_once_with_the_events_before(world, quick, waiting: bool) -> None:
    """For any clock before, and with or without a round awaited meanwhile."""
    live = world.opened(plugged := world.plug(boot_id=1, fingers_present=1))
    gaps = gaps_of(live.hand)
    plugged.firmware.after[wire.Start] = frame(1000) + frame(1001) + slip_at(10_020_000)
    last = live.hand.next_round(timeout_s=WAIT_S)
    assert plugged.firmware.received(wire.Subscribe)[-1].quantities & wire.QuantityFlags.EVENTS
    plugged.firmware.wait_for_looks()
    plugged.firmware.facts["boot_id"], plugged.firmware.streams = 2, 0
    plugged.firmware.t_us = 0
    plugged.firmware.after[wire.Start] = frame(1)
    if not waiting:
        until(gaps)
    now = live.hand.next_round(last, timeout_s=WAIT_S)
    assert (now.seq, now.t_us, now.missed, [event.kind for event in now.events]) == (
        1,
        10_000,
        0,
        [wire.EventKind.SLIP],
    )


def test_events_that_a_round_has_no_room_for_are_counted(world, quick) -> None:
    live = world.opened(plugged := world.plug(boot_id=1, fingers_present=1))
    plugged.firmware.after[wire.Start] = slip_at(9_990_000) * 1027 + frame(1000) + frame(1001)
    now = live.hand.next_round(timeout_s=WAIT_S)
    assert (len(now.events), now.events_lost) == (1024, 3)


def test_a_round_has_all_fingers_although_each_comes_in_a_read_of_its_own(live: Live) -> None:
    """From the second on, also if a loop was given the first before the other finger's frame had come."""
    with live.hand as hand:

        def send(seq: int, finger: int) -> None:
            live.send(frame(seq, finger))
            until(lambda: hand[finger].frame.seq == seq)

        hand.stream()
        given = threading.Event()
        sent: list[int] = []

        def send_first_finger() -> None:
            while not given.is_set():
                sent.append(len(sent) + 1)
                send(sent[-1], 0)

        alone = threading.Thread(target=send_first_finger)
        alone.start()
        now = hand.next_round(timeout_s=WAIT_S)
        given.set()
        alone.join()
        first = sent[-1]
        rest = [(first, 1), *((seq, finger) for seq in range(first + 1, first + 37) for finger in (0, 1))]
        sender = threading.Thread(target=lambda: [send(*row) for row in rest])
        sender.start()
        while now.seq < first + 36:
            now = hand.next_round(now, timeout_s=WAIT_S)
            assert now.seq < first + 2 or (now["index"].frame and now["middle"].frame)
        sender.join()


def test_no_round_comes_while_a_board_is_away_and_that_is_no_lost_board(world) -> None:
    live = world.opened(plugged := world.plug(boot_id=1))
    waits: list[str] = []

    def await_round() -> None:
        with pytest.raises(TimeoutError, match="no new round") as timed_out:
            live.hand.next_round(timeout_s=0)
        waits.append(str(timed_out.value))

    world.away(plugged, await_round, lambda: world.plug(boot_id=1))
    assert len(waits) == 1


def test_a_round_is_never_older_than_a_view_may_be(scripted_board, hello) -> None:
    firmware = Firmware(hello, fingers_present=1)
    live = Live(scripted_board(firmware), firmware, max_age_s=1e-9)
    with live.hand as hand:
        firmware.after[wire.Start] = frame(1) + frame(2)
        with pytest.raises(TimeoutError):
            hand.next_round(timeout_s=0.1)
        assert hand.stats.frames == 2
        with pytest.raises(biotac.InputError, match="timeout_s is nan"):
            hand.next_round(timeout_s=float("nan"))
