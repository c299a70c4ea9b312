"""Navarro's calibration and verification press on emulated hands."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from biotac.calibrate.press import CALIBRATION_FORCES_N, drive
from biotac.core import geometry
from biotac.errors import InputError
from biotac.sim import SimFinger, world
from biotac.sim.physics import PRESSURE_SPREAD
from biotac.wire import sensor
from biotac_lab.experiments import navarro2015 as navarro
from biotac_lab.experiments import navarro_active
from biotac_lab.report import Options, write

# Two lags of the emulated pressure change K: see tests/host/calibrate.
_COUNTS = np.array(CALIBRATION_FORCES_N) * 100 * (1 - 0.15) / PRESSURE_SPREAD
_PER_COUNT = _COUNTS.sum() / (_COUNTS**2).sum()
K_HIGH = 9 * _PER_COUNT
K_LOW = 0.15 * 1.8 / 60 + 9 * np.exp(-1.1 / 0.8) * _PER_COUNT


@pytest.fixture(scope="module")
def hands() -> list[navarro.Hands]:
    return [navarro.calibrate(21, "new"), navarro.calibrate(26, "worn")]


@pytest.mark.nightly
def test_the_verification_press_is_within_what_is_asked_on_both_profiles(hands, tmp_path: Path) -> None:
    report = navarro.run(Options(seed=21), hands)
    assert len(report.checks) == 6 and all(check["met"] for check in report.checks)
    assert [finger.seed for hand in hands for finger in hand.fingers] == list(range(21, 31))
    page, picture, _ = write(report, tmp_path, "navarro", "", overwrite=False)
    assert "| thumb | 10." in page.read_text() and "5.91 %" in page.read_text()
    assert picture.read_bytes()[:4] == b"\x89PNG"


@pytest.mark.nightly
def test_a_board_that_is_off_is_seen(hands) -> None:
    first, second = hands
    report = navarro.run(Options(seed=21), [replace(first, frames_checked=0), replace(second, violations=1)])
    assert [check["met"] for check in report.checks] == [True, False, True, False, True, True]


def test_k_holds_where_it_was_found_and_elsewhere_by_the_sensors_law() -> None:
    """The law is physics: K's value at another place follows from it without the code under test."""
    rows = navarro.places(21).rows
    errors = np.array([row[2:] for row in rows]) / 100
    x_mm = geometry.ELECTRODE_MM[[sensor.ELECTRODE_NAMES.index(row[0]) for row in rows], 0]
    touched = geometry.project(geometry.ELECTRODE_MM[[sensor.ELECTRODE_NAMES.index(row[0]) for row in rows]])
    finger = SimFinger(21)
    law = finger.pressure_gain * finger.loudness(touched) * (1 + 0.15 * np.tanh(x_mm / 8))
    off = np.array([row[1] for row in rows]) / 1e3 * 100 * law - 1
    assert (off >= -K_LOW).all() and (off <= K_HIGH).all()
    wanted = np.abs(law[None, :] / law[:, None] - 1)
    # K of the one place and the pressure at the other are each off by the lags
    assert (np.abs(errors - wanted) <= (K_HIGH + K_LOW) * (1 + wanted)).all()
    assert np.diag(errors).max() < 0.01 < 0.2 < errors.max()


# ---- active: the procedure drives the hand ------------------------------------------------------------


@pytest.mark.parametrize(
    ("fingers", "newtons"), [(("index", "thumb"), False), pytest.param(navarro.NAMES, True, marks=pytest.mark.nightly)]
)
def test_a_hand_calibrates_itself_finger_by_finger(fingers: tuple[str, ...], newtons: bool) -> None:
    found = navarro_active.calibrate(3, fingers, newtons=newtons)
    assert [finger.finger for finger in found] == list(fingers)
    forces = (2.0, 3.5, 5.0, 4.0) if newtons else tuple((deg - 15.0) * 0.7 for deg in (18.0, 20.0, 22.0, 21.0))
    for finger in found:
        assert (*finger.fit.press_forces_n, finger.verified.force_n) == pytest.approx(forces)
        own = SimFinger(3 + fingers.index(finger.finger)).pressure_gain
        law = 100 * own * (1 + 0.15 * np.tanh(geometry.ELECTRODE_MM[16, 0] / 8))  # the sensor's own, counts per N
        assert -K_LOW <= finger.fit.gain_n * law - 1 <= K_HIGH
        assert finger.verified.board_error < 0.01 and finger.verified.board_n != finger.verified.force_n


@pytest.mark.nightly
def test_a_hand_is_driven_in_the_paper_s_order_and_taken_back_when_it_fails() -> None:
    with world({"index": SimFinger(1), "thumb": SimFinger(2)}) as w:
        w.run(2.0)
        hand = navarro_active.PlateHand(w, ("index", "thumb"))
        drive(w.hand, hand.to_deg, hand.plate_n, (18, 20, 22, 21), next_round=hand.step, fingers=["thumb", "index"])
        targets = [move for move in hand.moves if move[1] is not None]
        three = [(name, deg) for name in ("thumb", "index") for deg in (18, 20, 22)]
        assert targets == [*three, ("thumb", 21), ("index", 21)]
        assert hand.moves[-1] == ("index", None)
        own = w.hand.board.calibration(1)
        hand.moves.clear()
        # a plate in kilogram-force's tenths, and one that is knocked at the last touch
        for times, words in ((6.0, "expected 0.003 to 0.05"), (1.0, "off on the verification press")):

            def plate_n(times: float = times) -> float:
                return hand.plate_n() * (times if len(hand.moves) < 7 else 3.0)

            with pytest.raises(InputError, match=words):
                drive(w.hand, hand.to_deg, plate_n, (18, 20, 22, 21), next_round=hand.step, fingers=["thumb"])
            assert w.hand.board.calibration(1) == own
            hand.moves.clear()
        with pytest.raises(InputError, match="never came: pressure rose by at most"):  # 14 degrees touch nothing
            drive(w.hand, hand.to_deg, hand.plate_n, (14, 14, 14, 14), next_round=hand.step)
        assert hand.moves[-1] == ("index", None)
        for touches, fingers, words in (((1, 2, 3), (), "expected four"), ((1, 2, 3, 4), ("toe",), "expected some of")):
            with pytest.raises(InputError, match=words):
                drive(w.hand, hand.to_deg, hand.plate_n, touches, fingers=fingers)
