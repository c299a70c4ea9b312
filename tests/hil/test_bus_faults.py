"""One finger's bus faults, seen through the whole chain: that finger's frames say so, and no other frame changes."""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from held_press import fault, held_press, of_finger

import biotac
from biotac import FrameFlags
from biotac.sim.fault_gen import EmuFault
from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire
from rig import Rig

INVALID = 0xFFFF
ASKED = 3  # of 30 rounds

HEALTHY = held_press(3)


def hurt_by(kind: str, channel: str | None = None) -> str:
    """The scenario with finger 1 hurt for 30 rounds."""
    return HEALTHY + fault(kind, 1.8, 0.3, channel=channel)


@pytest.fixture
def play(board, tmp_path: Path):
    """Stream a scenario text to the end; returns the frames, and the sensor counters of each finger."""

    def run(text: str) -> tuple[np.ndarray, list[wire.SensorStatus]]:
        path = tmp_path / "case.toml"
        path.write_text(text)
        hand = board(str(path))
        # The tare follows the temperature in contact: switched off, results rest on the electrodes alone.
        hand.board.set_setting(wire.Setting.THERMAL_GAIN_MILLI, 0)
        frames = hand.read_batch(100).frames
        return frames, [hand.sensor_status(f) for f in range(4)]

    return run


@pytest.mark.parametrize(
    ("kind", "counter"),
    [
        ("bad_parity", "words_parity"),
        ("stuck_low", "words_stuck"),
        ("stuck_high", "words_stuck"),
        ("error_word", "words_error"),
        ("no_channel", "words_error"),
    ],
)
def test_a_fault_on_one_finger_is_counted_there_and_touches_no_other(rig, play, kind: str, counter: str) -> None:
    if counter == "words_stuck":
        rig.need("silence")
    healthy, before = play(HEALTHY)
    faulty, after = play(hurt_by(kind))
    for finger in (0, 2):
        alike = of_finger(faulty, finger), of_finger(healthy, finger)
        if rig.facts.get("jitter"):
            alike[0]["t_us"] = alike[1]["t_us"]
        assert alike[0].tobytes() == alike[1].tobytes()
        assert getattr(after[finger], counter) == getattr(before[finger], counter) == 0
    # 0.3 s are 30 rounds of 44 words. A round without one good word is not sent at all, nor is one in which the
    # sensor is asked for its serial: three of those 30, and one when it is back.
    assert getattr(after[1], counter) == (30 - ASKED) * 44
    assert len(of_finger(healthy, 1)) - len(of_finger(faulty, 1)) == 31
    assert np.count_nonzero(np.diff(of_finger(faulty, 1)["t_us"]) == 31 * 10_000) == 1
    assert np.count_nonzero(np.diff(of_finger(faulty, 1)["t_us"]) == 2 * 10_000) == 1


def test_an_error_word_is_kept_for_the_user(play) -> None:
    _, status = play(hurt_by("error_word"))
    assert status[1].last_error_word == 0xA52D


def test_a_single_bad_channel_is_marked_missing_and_never_stale(play) -> None:
    frames, _ = play(hurt_by("bad_parity", "E5"))
    faulty = of_finger(frames, 1)
    hurt = np.flatnonzero(faulty["counts"][:, 4] == INVALID)
    assert hurt.tolist() == list(range(180, 210))
    missing = (faulty["flags"] & FrameFlags.ELECTRODE_MISSING) != 0
    assert np.array_equal(np.flatnonzero(missing), hurt)
    assert not np.any(np.delete(faulty["counts"], 4, axis=1) == INVALID)
    # The finger is still held: the tare and the contact outlive the fault.
    assert ((faulty["flags"][180:] & FrameFlags.CONTACT) != 0).all()


def test_a_missing_temperature_is_flagged_and_hurts_nothing_else(play) -> None:
    healthy, _ = play(HEALTHY)
    frames, _ = play(hurt_by("no_channel", "TDC"))
    faulty, whole = of_finger(frames, 1), of_finger(healthy, 1)
    hurt = slice(180, 210)
    assert (faulty["tdc"][hurt] == INVALID).all()
    assert ((faulty["flags"][hurt] & FrameFlags.TDC_MISSING) != 0).all()
    assert faulty["force_n"].tobytes() == whole["force_n"].tobytes()


def test_absent_sensors_send_nothing_and_read_as_stuck(play) -> None:
    frames, status = play(HEALTHY)
    assert set(frames["finger"]) == {0, 1, 2}
    assert status[3].present == 0
    assert status[3].words_good == 0
    assert status[3].words_stuck > 0


def test_the_bundled_fault_scenario_runs_clean_on_its_neighbours(board) -> None:
    hand = board("faults.toml")
    frames = hand.read_batch(100).frames
    assert len(of_finger(frames, 0)) == len(of_finger(frames, 2)) == 1200
    assert len(of_finger(frames, 1)) < 1200
    assert hand.stats.frames_lost == 0


def test_only_the_named_fingers_are_streamed(board) -> None:
    hand = board("press.toml?fingers=5&seconds=1")
    hand.stream("force", fingers=[1, 4])
    batch = hand.read_batch(100)
    assert set(batch.frames["finger"]) == {1, 4}
    assert len(batch.pac) == 0


def test_device_time_and_slots_are_exact_over_a_minute(board) -> None:
    hand = board("drift.toml?fingers=5")
    frames = hand.read(100)
    status = hand.status()
    assert status.slots_late == status.messages_dropped == 0
    # 44 slots at 4400 Hz are 10 ms; the fraction of a us per slot must not add up.
    for finger in range(5):
        assert hand.sensor_status(finger).words_good == 60 * 4400
        t_us = of_finger(frames, finger)["t_us"]
        assert np.array_equal(t_us - t_us[0], 10_000 * np.arange(6000))


def test_a_host_that_was_killed_leaves_no_stream_to_the_next(rig) -> None:
    board = rig.on_a_pty("press.toml", pace=1.0)
    killed = "import os, sys, biotac; hand = biotac.open(sys.argv[1]); hand.stream(); hand.read(0.1); os._exit(9)"
    assert subprocess.run([sys.executable, "-c", killed, board.path]).returncode == 9
    with biotac.open(board.path) as hand:
        assert hand.status().streams == 0


def test_a_word_that_comes_too_late_is_lost_and_shifts_no_other(rig, tmp_path: Path) -> None:
    rig.need("cable")
    path = tmp_path / "case.toml"
    path.write_text(HEALTHY)

    def played(*at_s: float) -> np.ndarray:
        hand = rig.open(str(path))
        hand.board.set_setting(wire.Setting.THERMAL_GAIN_MILLI, 0)
        for t_s in at_s:
            hand.link.board.plan(t_s, "stretch a word")
        return hand.read_batch(100).frames

    healthy, hurt = played(), played(0.70011, 0.90023, 1.10037)
    assert len(healthy) == len(hurt)
    lost = hurt["counts"] == INVALID
    assert 1 <= lost.sum() <= 3 * 5
    assert np.array_equal(hurt["counts"][~lost], healthy["counts"][~lost])


# ---- all sensors at once are changed for others: new serials, however their properties come

END = 40  # of the change, in rounds
#: Rounds that a finger may lose until it is known: the one of the question, and the one in which it came.
MAY_LOSE = {"": 2, "/words": 2, "/held": 10, "/bytes": 10}


@pytest.mark.parametrize("kind", MAY_LOSE)
def test_five_serials_are_read_within_3_s_whatever_way_they_come(rig: Rig, kind: str) -> None:
    if not rig.can("properties"):
        pytest.skip("a sensor board's sensors give their properties in one way only")
    source = load_source("press.toml", fingers=5, seconds=4)
    samples = source.samples.copy()
    samples[30:END] = EmuFault.SWAPPED
    own = [f"BTEMU0000000020{f}" for f in range(5)]
    hand = rig.open_with(replace(source, samples=samples, serials=tuple(serial + kind for serial in own)))
    assert [bytes(hand.sensor_info(f).serial).decode() for f in range(5)] == own
    frames = hand.read_batch(4).frames
    for finger in range(5):
        assert bytes(hand.sensor_info(finger).serial).decode() == own[finger][:-1] + "X"
        rows = frames[frames["finger"] == finger]
        rounds = rows["seq"].astype(int) - rows["seq"][0]
        sure = rounds[(rounds >= END) & (rows["flags"] & wire.FrameFlags.SENSOR_UNSURE == 0)][0]
        lost = sure - END - np.sum((rounds >= END) & (rounds < sure))
        assert sure - END <= 300 and lost <= MAY_LOSE[kind], (finger, sure, lost)
