"""A finger's own calibration on every rig: set, read, refused, cleared, in every frame; and after a power cut."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from kept_board import serial_of

import biotac
from biotac import Calibration, CalibrationState, PocWeights
from biotac.errors import CommandRefusedError
from biotac.recording.crosscheck import CrossCheck
from biotac.recording.reader import Recording
from rig import Rig

OWN = Calibration(
    PocWeights.COMPRESS_N2, (900_000, -800_000, 700_000), (600_000, -500_000), 300, "", 1_763_731_310, 9_500_000
)
GAIN_MAX_NN = 100_000_000  # a count; SPEC.md
BOOT_S = 5  # of the board's time


def for_finger(hand: biotac.Hand, finger: int) -> Calibration:
    return replace(OWN, serial=serial_of(hand, finger))


def test_a_calibration_is_set_told_and_cleared(board: Callable[[str], biotac.Hand]) -> None:
    hand = board("press.toml?fingers=2")
    assert [hand.board.calibration(f) for f in range(5)] == [None] * 5
    own_gains = for_finger(hand, 1)
    hand.board.set_calibration(1, own_gains)
    assert (hand.board.calibration(1), hand.board.calibration_state(1)) == (own_gains, CalibrationState.IN_FORCE)
    assert hand.board.calibration_state(0) == CalibrationState.NONE
    hand.board.clear_calibration(1)
    assert (hand.board.calibration(1), hand.board.calibration_state(1)) == (None, CalibrationState.NONE)


def test_another_sensors_is_refused_and_any_sensors_is_not(board: Callable[[str], biotac.Hand]) -> None:
    hand = board("press.toml?fingers=2")
    with pytest.raises(CommandRefusedError, match="OTHER_SENSOR"):
        hand.board.set_calibration(0, for_finger(hand, 1))
    with pytest.raises(CommandRefusedError, match="OTHER_SENSOR"):
        hand.board.set_calibration(4, for_finger(hand, 1))  # no sensor there
    assert hand.board.calibration(0) is None
    hand.board.set_calibration(0, OWN)
    assert hand.board.calibration_state(0) == CalibrationState.IN_FORCE


def test_frames_of_two_fingers_come_from_each_ones_own_gains(
    board: Callable[[str], biotac.Hand], tmp_path: Path
) -> None:
    hand = board("shear.toml?fingers=2&seconds=3")
    hand.board.set_calibration(1, for_finger(hand, 1))
    settings, own = hand.board.settings(), hand.board.finger_settings()
    hand.record(tmp_path / "two.mcap")
    messages = hand.read_batch(2.5).wire
    hand.close()
    touched = (messages["flags"] & biotac.FrameFlags.CONTACT) != 0
    assert {int(f) for f in messages["finger"][touched]} == {0, 1}
    right, blind = CrossCheck(), CrossCheck()
    right.add(messages, settings, own)
    assert (right.violations, right.frames) == (0, len(messages))
    blind.add(messages, settings)
    assert blind.violations > 50
    recording = Recording(tmp_path / "two.mcap")
    assert (recording.settings, recording.finger_settings) == (settings, own)


def test_gains_at_their_limits_are_as_exact_as_any_and_beyond_them_refused(board: Callable[[str], biotac.Hand]) -> None:
    hand = board("shear.toml?fingers=2&seconds=2.5")
    for finger, top in enumerate((GAIN_MAX_NN, -GAIN_MAX_NN)):
        limit = replace(OWN, force_gain_nn=(top, -top, top), torque_gain_nn=(-top, top), pressure_gain_nn=GAIN_MAX_NN)
        hand.board.set_calibration(finger, limit)
    with pytest.raises((CommandRefusedError, ValueError)):
        hand.board.set_calibration(0, replace(OWN, force_gain_nn=(GAIN_MAX_NN + 1, 0, 0)))
    settings, own = hand.board.settings(), hand.board.finger_settings()
    messages = hand.read_batch(100).wire
    touched = (messages["flags"] & biotac.FrameFlags.CONTACT) != 0
    assert {int(f) for f in messages["finger"][touched]} == {0, 1}
    assert np.abs(messages["force_100un"][touched]).max() > 200_000  # 20 N, of a press of less than one
    check = CrossCheck()
    check.add(messages, settings, own)
    assert (check.violations, check.frames) == (0, len(messages))


def test_a_saved_calibration_holds_after_power_was_off(rig: Rig) -> None:
    rig.need("power")
    hand = rig.open("press.toml?fingers=2&pace=fast")
    hand.stop()
    hand.link.release()
    own_gains = for_finger(hand, 0)
    hand.board.set_calibration(0, own_gains)
    hand.board.set_calibration(1, OWN)
    hand.board.save_settings()
    hand.board.clear_calibration(0)  # not saved
    reboot(hand, 2)
    assert hand.board.calibrations() == {0: own_gains, 1: OWN}
    hand.board.clear_calibration(0)
    hand.board.save_settings()
    reboot(hand, 3)
    assert hand.board.calibrations() == {1: OWN}


def reboot(hand: biotac.Hand, boots: int) -> None:
    board = hand.link.board  # type: ignore[attr-defined]
    board.send_line("cut power")
    board.until(BOOT_S, boots=boots, usb={"state": "configured"})
    # A sensor's saved record is in force once the sensor, which had no power either, has said which one it is.
    asked = 0
    while not all(serial_of(hand, finger) for finger in (0, 1)):
        asked += 1
        assert asked < 1000
