"""The link to the host: enumeration, handshake, a host that stops reading, a cable pulled, power lost."""

import random
import time
from pathlib import Path

import numpy as np
import pytest
from capture import Capture

import biotac
from biotac.wire import messages_gen as wire
from biotac.wire.batches import StreamDecoder
from rig import Rig

# Faults that silicon would not forgive; the emulator counts them.
BREACHES = ("toggle_errors", "available_not_last")


def test_the_board_says_what_it_is(rig) -> None:
    hand = rig.open()
    assert hand.info.board == (rig.facts.get("board_id") or hand.info.board)
    assert hand.info.slot_hz == 4400
    assert any(hand.info.board_serial)
    for finger in hand.fingers:
        info = hand.sensor_info(finger)
        assert bytes(info.serial).startswith(b"BT")
        if rig.can("properties"):
            assert info.sampling_hz == 4400


@pytest.mark.daily
def test_usb_and_the_sensors_bus_break_no_rule(rig) -> None:
    rig.need("counters")
    hand = rig.open("press.toml?fingers=5&seconds=0.5")
    assert len(hand.read(10)) == 250
    counters = hand.link.board.counters()
    usb, bus = counters["usb"], counters["sensors"]
    assert usb["state"] == "configured"
    assert usb["failed"] == []
    assert {key: usb[key] for key in BREACHES} == dict.fromkeys(BREACHES, 0)
    assert usb["device"]["address"] == 5  # as the host of the rig chose
    assert usb["device"]["serial"]
    # An interface association wants this triple (ECN of USB 2.0, table 1); Windows goes by it.
    assert usb["device"]["class"] == [0xEF, 0x02, 0x01]
    assert bus["select_setup_ns"] >= 1800  # as SynTouch's library leaves
    assert bus["early_reads"] == [0] * 5
    assert bus["misconfigured"] == 0
    # Only sample commands may go to several at once; the last slot's is out when time ends.
    assert bus["overlaps"] == 50 * 44 + 1


@pytest.mark.parametrize("fingers", range(1, 6))
def test_every_slot_of_one_to_five_fingers_is_sampled_and_nothing_lost(board, fingers: int) -> None:
    hand = board(f"press.toml?fingers={fingers}&seconds=1")
    assert hand.fingers == list(range(fingers))
    frames = hand.read(10)
    status = hand.status()
    assert (status.slots_late, status.messages_dropped, hand.stats.frames_lost) == (0, 0, 0)
    for finger in range(5):
        sensor = hand.sensor_status(finger)
        assert sensor.words_good == (100 * 44 if finger < fingers else 0)
        assert sensor.words_parity == sensor.words_error == 0
        of_one = frames[frames["finger"] == finger]
        assert len(of_one) == (100 if finger < fingers else 0)


def test_the_host_has_all_frames_of_a_round_soon_after_its_last_electrode(rig) -> None:
    rig.need("counters")
    hand = rig.open("press.toml?fingers=5&seconds=4")
    assert len(hand.read(10)) == 5 * 400
    latency = hand.link.board.counters()["latency"]
    assert (latency["frames"], latency["unmatched"]) == (5 * 400, 0)
    # Up to 260 us at the end of a USB frame, in which nothing may be armed (RP2040-E15).
    assert latency["p99_us"] <= 1000 + 260
    assert latency["worst_us"] <= 1500 + 260  # rounds that bring five TAREs, or STATUS, are longer by those


def test_the_same_scenario_gives_the_same_bytes(board) -> None:
    def played():
        batch = board("press.toml?seconds=2").read_batch(10)
        return batch.wire.tobytes(), batch.pac.tobytes()

    assert played() == played()


def test_a_host_that_stops_reading_loses_whole_frames_and_the_board_counts_them(rig) -> None:
    rig.need("cable")
    hand = rig.open("press.toml?fingers=5&seconds=2")
    hand.link.board.plan(1.0, "stop reading for 500 ms")
    with pytest.warns(biotac.ReadWarning, match="frames were lost on the link"):
        frames = hand.read(10)
    status = hand.status()
    assert status.messages_dropped > 0
    assert hand.stats.frames_lost > 100  # half a second of five fingers, less the ring's content
    assert (hand.stats.crc_errors, hand.stats.other_errors) == (0, 0)
    assert status.slots_late == 0  # sampling does not care
    # Nor is the controller mistaken for a hung one (RP2040-E15): the stream goes on from the same place.
    assert len(frames) + hand.stats.frames_lost == 5 * 200


@pytest.mark.parametrize("seconds", [20, pytest.param(600, marks=pytest.mark.nightly)])
def test_of_a_host_that_stands_still_for_so_long_every_message_is_counted(
    rig: Rig, tmp_path: Path, seconds: int
) -> None:
    rig.need("starting")
    rig.need("dropping")
    source = tmp_path / "rest.toml"
    source.write_text(f'name = "rest"\n[[step]]\ndo = "rest"\nseconds = {seconds}\n')
    hand = rig.play(f"{source}?pace=1e6")  # the board then drops frames that it cannot hand over
    hand.board.command(wire.Start(9, int(wire.StreamFlags.FRAMES), 1, 0))
    standstill = Capture(still=True)
    hand.add(standstill)
    hand.link.release()
    while not hand.link.board.over:
        hand.link.board.receive(None)
    standstill.resume.set()
    sent = -1
    while sent != (sent := len(standstill.sent)):  # no room for an answer before
        time.sleep(0.5)
    status = hand.status()
    rounds, others = 100 * seconds, 1 + 3  # a TARE, and answers without room
    assert rounds <= hand.stats.frames + status.messages_dropped <= rounds + others
    assert hand.stats.frames < 1000 and hand.stats.crc_errors == hand.stats.other_errors == 0
    assert status.faults & biotac.FaultFlags.DROPPED
    assert status.slots_late == 0 and hand.sensor_status(0).words_good == 44 * rounds


def interrupted(rig: Rig, leave: str, come_back: str) -> biotac.Hand:
    """A hand that streamed for two seconds, without a host from 1.2345 to 1.5."""
    rig.need("cable")
    hand = rig.open("press.toml?fingers=5&seconds=2")
    hand.link.board.plan(1.2345, leave)
    hand.link.board.plan(1.5, come_back)
    frames = hand.read(10)
    assert 90 * 5 < len(frames) < 125 * 5
    return hand


@pytest.mark.daily
def test_a_cable_pulled_in_mid_frame_stops_the_stream_and_a_new_host_is_served(rig) -> None:
    hand = interrupted(rig, "unplug", "plug")
    assert hand.link.board.counters()["usb"]["state"] == "configured"
    status = hand.status()
    assert status.streams == 0
    assert status.slots_late == 0
    assert hand.sensor_status(4).words_good == 200 * 44


def test_a_bus_that_is_suspended_ends_the_stream_and_is_served_after_it(rig) -> None:
    hand = interrupted(rig, "suspend", "resume")
    usb = hand.link.board.counters()["usb"]
    assert (usb["state"], usb["hangs"], usb["failed"]) == ("configured", 0, [])
    status = hand.status()
    assert (status.streams, status.slots_late) == (0, 0)
    assert hand.sensor_status(4).words_good == 200 * 44


PIECE = 4000  # bytes; the last two are whole: the piece behind a loss tells it


def hurt(sent: bytes, draw: random.Random) -> bytes:
    """As a bad line has it: pieces lose bytes, come doubled, with bits flipped, behind older bytes, or out of order."""
    out = sent[:PIECE]
    end = len(sent) // PIECE * PIECE - 2 * PIECE
    for at in range(PIECE, end, PIECE):
        size, whole = draw.randrange(1, PIECE // 2), sent[at : at + PIECE]
        flipped = bytearray(whole)
        for _ in range(draw.randint(1, 8)):
            flipped[draw.randrange(32)] ^= 1 << draw.randrange(8)
        doubled, spliced = sent[at - size : at] + whole, sent[at - 2 * size : at - size] + whole
        swapped = whole[size : 2 * size] + whole[:size] + whole[2 * size :]
        out += draw.choice((whole[size:], bytes(flipped), doubled, spliced, swapped))
    return out + sent[end:]


def test_of_what_a_bad_line_brings_each_frame_is_as_sent_and_the_rest_counted(board) -> None:
    hand = board("press.toml?fingers=5&seconds=1")
    capture = Capture()
    hand.add(capture)
    hand.read(10)
    sent = capture.sent
    truth = StreamDecoder().feed(sent)
    assert len(truth.wire) == 500
    for seed in range(20):
        decoder = StreamDecoder()
        came = decoder.feed(hurt(bytes(sent), random.Random(seed)))
        missing = doubled = 0
        for finger in range(5):
            played, arrived = (np.flatnonzero(one.wire["finger"] == finger) for one in (truth, came))
            at = played[np.searchsorted(truth.seq[played], came.seq[arrived])]
            assert (came.wire[arrived] == truth.wire[at]).all() and (came.t_us[arrived] == truth.t_us[at]).all()
            missing += len(played) - len(np.unique(at))
            doubled += len(arrived) - len(np.unique(at))
        stats = decoder.stats(0, 0)
        assert missing == stats.frames_lost > 0
        assert doubled <= stats.disordered


def test_a_board_that_lost_power_is_another_boot(rig, tmp_path: Path) -> None:
    rig.need("power")
    board = rig.on_a_pty("press.toml", pace=0)
    with biotac.open(board.path) as hand:
        first = hand.info
    board.send_line("cut power")
    with biotac.open(board.path) as hand:
        assert hand.info.boot_id != first.boot_id
        assert hand.info.board_serial == first.board_serial
    assert board.counters()["boots"] == 2


def test_recorded_counts_give_the_same_results_as_the_simulated_board(board, shared_data: Path) -> None:
    trial = shared_data / "robotic_finger" / "trial_15330.npz"
    on_rig = board(str(trial)).read_batch(1000).wire
    with biotac.open(f"sim:{trial}") as hand:
        simulated = hand.read_batch(1000).wire
    assert len(on_rig) == len(simulated) == 5185
    for field in set(wire_fields(on_rig)) - {"t_us"}:  # boards do not start at the same microsecond
        assert on_rig[field].tobytes() == simulated[field].tobytes(), field


def wire_fields(frames: np.ndarray) -> tuple[str, ...]:
    assert frames.dtype.names is not None
    return frames.dtype.names
