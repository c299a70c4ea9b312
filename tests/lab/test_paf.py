"""PAF on emulated presses, the filters against straight lines and outliers, scores against sums."""

import numpy as np
import pytest

from biotac.errors import InputError
from biotac.sim.physics import SimFinger
from biotac_lab.experiments.scores import score
from biotac_lab.features.paf import paf
from biotac_lab.features.signals import skin
from biotac_lab.learn.smooth import causal, causal_taps, low_pass, lowess
from biotac_lab.learn.stimulations import stimulate


def test_errors_under_mixed_loads() -> None:
    """RMSE d <= 2.3 mm and r <= 2.2 mm with the threshold, straight and tilted presses of all probes."""
    rows = stimulate(SimFinger(1), (30, 30, 30, 30), seed=1, frames=12)
    found = paf(rows.counts - rows.tare)
    error = (found["dr_mm"] - skin(rows.contact_mm))[found["valid"]]
    d, r = np.sqrt((error**2).mean(axis=0))
    assert d <= 2.3 and r <= 2.2
    light = np.linalg.norm(rows.force_n, axis=1)[~found["valid"]]
    assert len(light) and np.median(light) < 2.0, "what the threshold holds back is light"


def test_lowess_keeps_a_line_and_drops_an_outlier() -> None:
    line = 0.3 * np.arange(60.0) - 2.0
    noisy = line + np.random.default_rng(1).normal(0.0, 0.1, 60)
    spoilt = noisy.copy()
    spoilt[30] += 3.0
    spoilt[10] = noisy[10] = np.nan
    both = lowess(np.column_stack([line, spoilt]))
    np.testing.assert_allclose(both[:, 0], line, atol=1e-9)
    assert np.isnan(both[10, 1])
    moved = np.abs(both[:, 1] - lowess(noisy))
    assert np.nanmax(moved) < 0.1, "30 sigma off moves the line by less than one"
    with pytest.raises(InputError, match="5 rows have a value: expected at least 11"):
        lowess(np.arange(5.0))


@pytest.mark.parametrize("sigmas", [30.0, 1e3, 1e6])
@pytest.mark.parametrize("row", [0, 3, 30, 59])
def test_lowess_gives_a_spike_no_weight_whatever_its_size(sigmas: float, row: int) -> None:
    noisy = 0.3 * np.arange(60.0) - 2.0 + np.random.default_rng(1).normal(0.0, 0.1, 60)
    spoilt = noisy.copy()
    spoilt[row] += 0.1 * sigmas
    assert np.abs(lowess(spoilt) - lowess(noisy)).max() < 0.05, "a spike moves nothing by more than half a deviation"
    level = np.full(40, 7.0)
    level[20] += sigmas
    np.testing.assert_allclose(lowess(level), 7.0)
    curve = np.sin(np.arange(200) / 20.0)
    assert np.abs(lowess(curve) - curve).max() < 0.01, "nor does a bend pass for outliers"


@pytest.mark.parametrize("rows", [2, 3, 5])
def test_lowess_keeps_a_short_touch(rows: int) -> None:
    touched = np.zeros(60)
    touched[30 : 30 + rows] = 2.0
    np.testing.assert_allclose(lowess(touched)[30 : 30 + rows], 2.0, atol=0.1)


def test_the_low_pass_is_the_paper_s() -> None:
    at = np.arange(1000) / 100.0
    for hz in (0.5, 5.0, 20.0):  # a third-order Butterworth's gain, warped as bilinear filters are
        ratio = np.tan(np.pi * hz / 100.0) / np.tan(np.pi * 5.0 / 100.0)
        passed = low_pass(np.sin(2.0 * np.pi * hz * at), 100.0)[600:]
        assert np.sqrt(2.0 * (passed**2).mean()) == pytest.approx((1.0 + ratio**6) ** -0.5, rel=1e-3)
    lag_s = 2.0 / (2.0 * 100.0 * np.tan(np.pi * 5.0 / 100.0))  # of three such poles, for slow signals
    np.testing.assert_allclose(
        low_pass(np.column_stack([at, at - 3.0]), 100.0)[-1], [at[-1] - lag_s, at[-1] - 3 - lag_s]
    )
    with pytest.raises(InputError, match="8 rows a second: expected more than 10"):
        low_pass(at, 8.0)


def test_the_causal_taps_are_the_reference_s_and_follow_a_slope_without_lag() -> None:
    printed = [-0.006, -0.031, -0.058, -0.068, -0.049, 0.0, 0.071, 0.155, 0.243, 0.329, 0.413]
    np.testing.assert_allclose(causal_taps(), printed, atol=6e-4)
    line = 0.3 * np.arange(40.0) - 2.0
    smooth = causal(line)
    assert np.isnan(smooth[:10]).all()
    np.testing.assert_allclose(smooth[10:], line[10:])
    assert causal(np.ones((12, 2))).shape == (12, 2)


def test_scores_by_hand() -> None:
    found = score(np.array([1.0, 2.0, 4.0]), np.array([1.0, 3.0, 5.0]))
    assert found["rmse"] == pytest.approx(np.sqrt(2 / 3), abs=1e-4)
    assert found["smse"] == pytest.approx((2 / 3) / (8 / 3), abs=1e-4)
    assert found["r2"] == pytest.approx(np.corrcoef([1, 2, 4], [1, 3, 5])[0, 1] ** 2, abs=1e-4)
    assert found["percent"] == pytest.approx(100.0 * (0.5 + 1.0) / (2.0 + 4.0))
    assert found["printed"] == pytest.approx(100.0 * (1 / 3 + (1 / 3 + 1 / 5)) / 4, abs=1e-4)
    assert score(np.array([1.0, np.nan]), np.array([1.0, 2.0]))["rmse"] is None
    assert score(np.array([1.0, 2.0]), np.array([0.0, 0.0]))["percent"] is None
