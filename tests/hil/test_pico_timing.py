"""The Pico's slots as seen on the bus, in device time: rate, jitter, and the sensor's 50 us and 5 us rules."""

import pytest

import biotac
from biotac.hand.opening import shake_hands
from biotac.sim.loading import load_source
from biotac_rig.emulated import EmulatedBoard
from rig import Rig

SECONDS = 1
SLOT_US = 1e6 / 4400


@pytest.mark.daily
def test_slots_are_on_time_and_the_bus_rules_kept_while_five_fingers_stream(rig: Rig) -> None:
    rig.need("counters")
    hand = rig.open(f"press.toml?fingers=5&seconds={SECONDS}")
    assert len(hand.read(100)) == 5 * 100 * SECONDS
    counters = hand.link.board.counters()  # type: ignore[attr-defined]
    seen = counters["timing"]
    assert seen["slots"] == SECONDS * 4400 + 1  # the one behind the last ends the source
    assert seen["hz"] == pytest.approx(4400, rel=1e-6)
    earliest, latest = seen["slot_deviation_us"]
    assert latest - earliest <= 2
    assert seen["settle_us"] >= 50  # product manual
    assert seen["gap_us"] >= 5
    assert seen["interrupt_us"] < SLOT_US / 2
    assert counters["slept"] > 0.5


@pytest.mark.nightly
def test_ten_minutes_of_five_fingers_lose_no_slot(rig: Rig) -> None:
    rig.need("counters")
    hand = rig.open("press.toml?fingers=5&seconds=601&pace=fast")
    hand.read(600)
    seen = hand.link.board.counters()["timing"]  # type: ignore[attr-defined]
    print(f"{seen['slots']} slots, deviation {seen['slot_deviation_us']} us, interrupt {seen['interrupt_us']} us")
    assert seen["hz"] == pytest.approx(4400, rel=1e-6)
    earliest, latest = seen["slot_deviation_us"]
    assert latest - earliest <= 2
    assert (hand.status().slots_late, hand.stats.frames_lost) == (0, 0)


@pytest.mark.nightly
def test_an_event_is_with_the_host_a_millisecond_after_its_slot_or_in_the_next_usb_frame(rig: Rig) -> None:
    rig.need("counters")
    hand = rig.open("press.toml?fingers=5&seconds=3")
    events: list[biotac.Event] = []
    hand.on_event(events.append)
    frames = hand.read(100)
    seen = hand.link.board.counters()["latency"]  # type: ignore[attr-defined]
    print(f"the slowest EVENT of a slot {seen['event_us']:.0f} us, TRUST {seen['trust_us']:.0f} us")
    assert {event.kind for event in events} >= {biotac.EventKind.TOUCH, biotac.EventKind.TRUST}
    assert len(frames) == 1500
    assert seen["events"] >= 5
    # A packet that comes in the last 260 us of a frame waits for the next one (RP2040-E15; usb/data.c).
    assert seen["event_us"] <= 1000 + 260
    # TRUST is known as a finger's FRAME is made, and goes behind it: the last finger's behind five FRAMEs, and five
    # TAREs as all are tared at once. The bound is that of these (test_link.py); the slot is the round's last.
    assert seen["event_us"] < seen["trust_us"] <= 1500 + 260


def test_every_frames_arrival_is_told_and_none_comes_before_its_round_is_over(rig: Rig) -> None:
    rig.need("counters")
    hand = rig.open("press.toml?fingers=2&seconds=1")
    frames = hand.read(10)
    arrivals = hand.link.board.arrivals()  # type: ignore[attr-defined]
    assert [(t_us, finger) for t_us, finger, _ in arrivals] == list(zip(frames["t_us"], frames["finger"], strict=True))
    late_us = [us - (t_us + 43 * SLOT_US) for t_us, _, us in arrivals]  # after the command of the round's last slot
    assert min(late_us) > 50  # the sensor needs that long before it is read
    assert max(late_us) < 10_000


def test_the_core_clocks_the_same_words_as_the_dma(rig: Rig) -> None:
    """By the setting slots_by_core, for an evening on which the DMA deviates from the data sheet."""
    rig.need("counters")
    runs = []
    for by_core in (0, 1):
        board = EmulatedBoard(
            rig.facts["board"], load_source("press.toml", fingers=5, seconds=1.0), pace=0.0, hold=True
        )
        rig.opened.append(board)
        with biotac.open(board.path) as hand:
            hand.board.set_setting(biotac.Setting.SLOTS_BY_CORE, by_core)
            hand.board.save_settings()
        board.do("cut power")  # the setting counts from the next start on
        board.until(1, usb={"state": "configured"})
        with shake_hands(board.link("pico")) as hand:
            runs.append(hand.read_batch(1.0).wire)
            assert hand.status().slots_late == 0
            assert (board.counters()["timing"]["interrupt_us"] > SLOT_US / 5) == (by_core == 1)
    both = [rows[[name for name in rows.dtype.names if name != "t_us"]] for rows in runs]
    assert len(both[0]) > 400 and (both[0] == both[1]).all()
