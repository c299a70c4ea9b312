"""A loose connector in a grasp: one finger is away for 10 ms to 10 s while it holds 3 N, or comes back as another."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from held_press import fault, held_press, of_finger

import biotac
from biotac import Calibration, CalibrationState, FrameFlags, PocWeights
from biotac.wire import messages_gen as wire
from rig import Rig

AWAY_S = 2.5  # world time; the hold began at 1.5 s
HELD_N = 3.0
BACK_ROUNDS = 5  # 50 ms
# Without thermal gain: the tare follows the temperature in contact, and a whole round without it would differ.
OWN = Calibration(PocWeights.COMPRESS_N2, (9_000_000, 3_000_000, 26_000_000), (600_000, -500_000), 0, "", 1_763_731_310)

_undisturbed: dict[tuple[str, float], np.ndarray] = {}  # frames by rig and duration of the fault


def for_finger(hand: biotac.Hand, finger: int) -> Calibration:
    return replace(OWN, serial=bytes(hand.sensor_info(finger).serial).rstrip(b"\0").decode())


def play(rig: Rig, tmp_path: Path, seconds: float, kind: str | None, *, calibrated: bool = False):
    """Frames of the scenario, and the hand after it. Two seconds remain after the fault."""
    rig.need("scenarios")
    text = held_press(2, force_n=HELD_N, hold_s=AWAY_S - 1.5 + seconds + 2)
    if kind is not None:
        text += fault(kind, AWAY_S, seconds)
    path = tmp_path / "held.toml"
    path.write_text(text)
    hand = rig.open(str(path))
    hand.board.set_setting(wire.Setting.THERMAL_GAIN_MILLI, 0)
    hand.board.set_setting(wire.Setting.FORCE_MODEL, wire.ForceModel.LIN)  # which the emulated finger's physics follow
    if calibrated:
        hand.board.set_calibration(1, for_finger(hand, 1))
    return hand.read_batch(100).frames, hand


def split(frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frames before and after the longest gap."""
    cut = int(np.argmax(np.diff(frames["t_us"].astype(np.int64)))) + 1
    return frames[:cut], frames[cut:]


def undisturbed(rig: Rig, tmp_path: Path, seconds: float) -> np.ndarray:
    """Frames of the scenario without a fault: the same for every kind."""
    if (rig.name, seconds) not in _undisturbed:
        frames, hand = play(rig, tmp_path, seconds, None, calibrated=True)
        hand.close()
        _undisturbed[rig.name, seconds] = frames
    return _undisturbed[rig.name, seconds]


# "unplugged" is mute until it is asked.
GONE_S = (0.010, 0.014, 0.1, 0.4, 1.0, 2.0, 4.0)
KINDS = ("stuck_low", "unplugged")
DROPOUTS = [(seconds, kind) for kind in KINDS for seconds in (*GONE_S, 10.0)]


@pytest.mark.parametrize(("seconds", "kind"), DROPOUTS)
def test_a_held_force_is_back_within_50_ms_when_the_same_sensor_is(
    rig: Rig, tmp_path: Path, seconds: float, kind: str
) -> None:
    whole = undisturbed(rig, tmp_path, seconds)
    frames, hand = play(rig, tmp_path, seconds, kind, calibrated=True)
    assert of_finger(frames, 0).tobytes() == of_finger(whole, 0).tobytes()
    _, after = split(of_finger(frames, 1))
    back = after[np.argmax(np.all(after["counts"] != wire.INVALID_COUNT, axis=1)) :]  # from the first good round
    sure = back["t_us"] >= back["t_us"][0] + BACK_ROUNDS * 10_000
    assert np.all(back["flags"][sure] & (FrameFlags.SENSOR_UNSURE | FrameFlags.SENSOR_OTHER) == 0)
    held = of_finger(whole, 1)["force_n"][np.isin(of_finger(whole, 1)["t_us"], back["t_us"][sure])]
    assert len(held) == sure.sum() > 100
    assert np.linalg.norm(held, axis=1).min() > 0.5  # it does hold something
    assert np.all(np.linalg.norm(back["force_n"][sure] - held, axis=1) <= 0.05 * np.linalg.norm(held, axis=1))
    assert np.all(back["flags"][sure] & FrameFlags.CONTACT != 0)
    assert hand.board.calibration_state(1) == CalibrationState.IN_FORCE


@pytest.mark.parametrize("seconds", [0.010, 0.1, 1.0])
def test_another_sensor_is_refused_and_that_is_said(rig: Rig, tmp_path: Path, seconds: float) -> None:
    whole = undisturbed(rig, tmp_path, seconds)
    frames, hand = play(rig, tmp_path, seconds, "swapped", calibrated=True)
    assert of_finger(frames, 0).tobytes() == of_finger(whole, 0).tobytes()
    before, after = split(of_finger(frames, 1))
    assert np.all(before["flags"] & FrameFlags.SENSOR_OTHER == 0)
    sure = after["t_us"] >= after["t_us"][0] + BACK_ROUNDS * 10_000
    flags = after["flags"]
    assert np.all(flags[sure] & FrameFlags.SENSOR_OTHER)
    # Until the sensor's serial is known, every result is flagged; afterwards there is no result.
    assert np.all(flags & (FrameFlags.SENSOR_OTHER | FrameFlags.SENSOR_UNSURE))
    assert np.all(np.isnan(after["force_n"][sure]))
    assert bytes(hand.sensor_info(1).serial).rstrip(b"\0").endswith(b"X")
    hand.stop()
    assert hand.board.calibration_state(1) == CalibrationState.OTHER_SENSOR


def test_a_sensor_of_another_type_is_named_and_its_force_never_sure(rig: Rig, tmp_path: Path) -> None:
    """A BioTac SP answers to the same commands, and to E20 besides: the electrodes lie elsewhere."""
    rig.need("scenarios")
    path = tmp_path / "held.toml"
    path.write_text(held_press(2) + '[[finger]]\n[[finger]]\nserial = "BTSP050400018017"\n')
    hand = rig.open(str(path))
    frames = hand.read_batch(100).frames
    assert hand.fingers == [0]
    sensor = hand.sensor_info(1)
    assert (sensor.present, bytes(sensor.serial)) == (0, b"BTSP050400018017")
    foreign, other = of_finger(frames, 1), of_finger(frames, 0)
    assert len(foreign) > 200 and np.all(foreign["flags"] & FrameFlags.SENSOR_UNSURE)
    assert np.all(foreign["flags"] & FrameFlags.SENSOR_FAULT) and np.isnan(foreign["force_n"]).all()
    assert not np.any(other["flags"] & (FrameFlags.SENSOR_UNSURE | FrameFlags.SENSOR_OTHER))
    latched = hand.board.faults().by_index
    assert latched[1] & FrameFlags.SENSOR_UNSURE and not latched[0] & FrameFlags.SENSOR_UNSURE


def test_two_sensors_swapped_are_both_refused(rig: Rig, tmp_path: Path) -> None:
    rig.need("scenarios")
    path = tmp_path / "swapped.toml"
    path.write_text(held_press(2, hold_s=0.7) + fault("swapped", 1.6, 0.1, 0) + fault("swapped", 1.6, 0.1, 1))
    hand = rig.open(str(path))
    for finger in (0, 1):
        hand.board.set_calibration(finger, for_finger(hand, finger))
    frames = hand.read_batch(100).frames
    for finger in (0, 1):
        _, after = split(of_finger(frames, finger))
        assert np.all(after["flags"] & (FrameFlags.SENSOR_OTHER | FrameFlags.SENSOR_UNSURE))
        assert np.all(np.isnan(after["force_n"][BACK_ROUNDS:]))
        assert hand.board.faults().by_index[finger] & FrameFlags.SENSOR_OTHER


def test_lost_rounds_and_words_at_rest_change_nothing(rig: Rig, tmp_path: Path) -> None:
    rig.need("scenarios")
    text = 'name = "rest"\nseed = 5\n[[step]]\ndo = "rest"\nseconds = 4.0\n'
    for k, kind in enumerate(["bad_parity", "stuck_low", "error_word", "unplugged"]):
        for at_s, seconds in ((1.0 + k * 0.7, 0.004), (1.3 + k * 0.7, 0.02)):
            text += fault(kind, at_s, seconds, finger=0)
    path = tmp_path / "rest.toml"
    path.write_text(text)
    hand = rig.open(str(path))
    frames = hand.read_batch(100).frames
    assert np.all(frames["flags"] & FrameFlags.CONTACT == 0)
    assert np.count_nonzero(frames["flags"] & FrameFlags.TARE_CHANGED) == 1  # START
    assert hand.sensor_status(0).tare_reason == wire.TareReason.START
