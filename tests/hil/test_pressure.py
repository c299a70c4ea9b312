"""Force from static pressure on every rig: sent with a gain, not without, and all of the guided calibration."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import biotac
from biotac import Calibration, Setting
from biotac.kernels.compiled import default_settings
from biotac.recording.crosscheck import CrossCheck
from biotac.recording.reader import Recording
from biotac.sim.physics import Profile
from biotac.wire import messages_gen as wire
from biotac.wire.batches import Batch
from biotac_lab.experiments import navarro2015 as navarro
from rig import Rig

GAIN_NN = 12_345_678


def test_a_finger_without_a_gain_tells_pressure_and_no_force(board: Callable[[str], biotac.Hand]) -> None:
    hand = board("press.toml")
    frames = hand.read(2.0)
    assert np.isfinite(frames["pdc_filtered"]).all()
    assert np.isnan(frames["pressure_force_n"]).all()
    assert not (frames["flags"] & biotac.FrameFlags.NOT_ASKED).any()


def test_the_force_is_the_gain_times_pressure_above_rest_and_right_in_every_frame(
    board: Callable[[str], biotac.Hand], tmp_path: Path
) -> None:
    hand = board("press.toml?fingers=2")
    hand.board.set_calibration(1, replace(Calibration(), pressure_gain_nn=GAIN_NN))
    hand.board.set_setting(Setting.PRESSURE_FILTER_MILLI, 300)
    settings, own = hand.board.settings(), hand.board.finger_settings()
    hand.record(tmp_path / "pressed.mcap")
    batch = hand.read_batch(2.5)
    hand.close()
    pressed = batch.frames["finger"] == 1
    pressure_n = batch.frames["pressure_force_n"]
    assert np.isnan(pressure_n[~pressed]).all()
    # 5 N are pressed: 500 counts, but for the place's factor.
    tared = batch.wire["pdc_tare_q4"] != wire.INVALID_COUNT
    assert 4.0 < np.nanmax(pressure_n[pressed]) / (GAIN_NN / 1e7) < 6.0
    assert np.isfinite(pressure_n[pressed & tared]).all() and np.isnan(pressure_n[pressed & ~tared]).all()
    check = CrossCheck()
    check.add(batch.wire, settings, own)
    assert (check.violations, check.findings, check.pressure.starts) == (0, [], 2)
    assert 0 < check.pressure.filter_max <= check.pressure.filter_bound
    # Another gain or another filter gives another outcome: the check sees both.
    for change in ({Setting.PRESSURE_GAIN_NN: GAIN_NN + 1000}, {Setting.PRESSURE_FILTER_MILLI: 310}):
        wrong = CrossCheck()
        wrong.add(batch.wire, settings, {1: own[1] | change})
        assert wrong.violations > 20
    recording = Recording(tmp_path / "pressed.mcap")
    assert recording.calibrations[1].pressure_gain_nn == GAIN_NN
    np.testing.assert_array_equal(recording.frames["pressure_force_n"][: len(pressure_n)], pressure_n)


def test_what_is_not_asked_for_is_invalid_and_leaves_no_trace_in_what_is(board: Callable[[str], biotac.Hand]) -> None:
    """The same source three times: everything, force alone, and pressure alone with heartbeats at rest."""

    def played(*names: str, rest: bool = True) -> Batch:
        hand = board("press.toml")
        hand.board.set_calibration(0, replace(Calibration(), pressure_gain_nn=GAIN_NN))
        hand.stream(*names, rest=rest)
        return hand.read_batch(2.5)

    full = played()
    force = played("force")
    pressure = played("pressure", rest=False)
    assert np.isnan(force.frames["pdc_filtered"]).all() and np.isnan(force.frames["pressure_force_n"]).all()
    frames = pressure.frames
    assert 50 < len(frames) < len(full.frames) and np.isnan(frames["force_n"]).all()
    same = full.frames[np.searchsorted(full.frames["seq"], frames["seq"])]
    for name in ("pdc_filtered", "pressure_force_n"):
        np.testing.assert_array_equal(frames[name], same[name])
    assert (np.isfinite(frames["pressure_force_n"]).sum()) > 50
    settings = default_settings() | {Setting.PRESSURE_GAIN_NN: GAIN_NN}
    for batch, starts in ((full, 1), (force, 0), (pressure, None)):
        check = CrossCheck()
        check.add(batch.wire, settings)
        assert check.violations == 0
        assert starts is None or check.pressure.starts == starts
    # Only a frame that follows no other is taken as told.
    assert 1 <= check.pressure.starts <= 1 + len(pressure.idle)


@pytest.mark.parametrize(
    ("seed", "profile", "fingers"),
    [(1, "new", 1), *(pytest.param(*hand, marks=pytest.mark.nightly) for hand in ((1, "new", 5), (6, "worn", 5)))],
)
def test_fingers_are_calibrated_and_verified_on_board(rig: Rig, seed: int, profile: Profile, fingers: int) -> None:
    """The issue's figure: at most 5.9 %. Set, read back, streamed; the force is the scenario's."""
    rig.need("scenarios")
    rig.need("starting")
    board = rig.facts["board"]
    if fingers > 1 and rig.facts.get("slow", False):
        pytest.skip(f"{rig.name}: emulated time is slow, and the board's arithmetic is the same for all fingers")
    hands = navarro.calibrate(seed, profile, board=board, fingers=range(fingers))
    verified = [finger.verified for finger in hands.fingers]
    assert [finger.fit.finger for finger in hands.fingers] == list(range(fingers))
    for check in verified:
        assert check.force_n == pytest.approx(4.0)
        assert check.board_error <= 0.059 and check.float_error <= 0.059
        assert check.apart_n <= 0.5e-4 + 1e-9  # half of the board's unit
    assert hands.violations == 0
    assert hands.frames_checked > 1500 * fingers
