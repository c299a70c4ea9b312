"""PAF against the paper's equations by hand, its filters against straight lines and outliers, scores against sums."""

from __future__ import annotations

import numpy as np
import pytest

import biotac
from biotac.core import geometry as surface
from biotac.errors import InputError
from biotac.features import paf as paf_room
from biotac.features.paf import electrode_force, paf
from biotac.features.scores import score
from biotac.features.signals import ELECTRODE_DR_MM, signals, skin
from biotac.features.smooth import causal, causal_taps, lowess
from biotac.sim.physics import Finger
from biotac.sim.stimulations import stimulate
from biotac.wire.messages_gen import INVALID_COUNT


def counts(**electrodes: float) -> np.ndarray:
    """One row of signals from volts: E3=-0.5."""
    row = np.zeros((1, 19))
    for name, volt in electrodes.items():
        row[0, int(name[1:]) - 1] = volt * 4095 / 3.3
    return row


def test_equation_4_as_printed_and_without_its_rest() -> None:
    printed = electrode_force(counts(E3=-0.5, E4=0.3), as_printed=True)[0]
    assert printed[2] == pytest.approx(6.083 / 1.476)
    assert printed[3] == pytest.approx(6.083 / 2.276)
    assert printed[0] == pytest.approx(3.0784, abs=1e-4)  # numerics.md 1.2
    ours = electrode_force(counts(E3=-0.5, E4=0.3))[0]
    assert ours[2] == pytest.approx(6.083 / 1.476 - 6.083 / 1.976)
    assert ours[3] == ours[0] == 0.0
    beyond = electrode_force(counts(E3=-2.1), as_printed=True)[0, 2]
    assert beyond == pytest.approx(40.0), "beyond the pole it saturates"


def test_equation_5_is_the_weighted_mean_of_three() -> None:
    row = counts(E1=-0.9, E2=-0.5, E18=-0.2, E5=-0.1)
    force = electrode_force(row)[0]
    three = [0, 1, 17]
    expected = (force[three, None] * ELECTRODE_DR_MM[three]).sum(axis=0) / force[three].sum()
    its = paf(row, threshold_n=0.0)
    np.testing.assert_allclose(its["dr_mm"][0], expected)
    assert its["force_n"][0] == pytest.approx(force[three].sum()) and its["valid"][0]


def test_what_is_too_light_or_missing_is_flagged_and_the_printed_threshold_holds_nothing_back() -> None:
    rest = np.zeros((1, 19))
    its = paf(rest)
    assert not its["valid"][0] and np.isnan(its["dr_mm"]).all() and its["force_n"][0] == 0.0
    assert paf(rest, as_printed=True)["valid"][0]
    missing = counts(E3=-0.9)
    missing[0, 7] = np.nan
    its = paf(missing, threshold_n=0.0)
    assert not its["valid"][0] and np.isnan(its["force_n"][0])


def test_rows_of_a_board_and_their_missing_electrodes() -> None:
    with biotac.open("sim:press.toml") as hand:
        rows = hand.read(seconds=8.0)
    above = signals(rows)
    good = np.isfinite(rows["tare"]).all(axis=1)
    assert good.any() and np.isnan(above[~np.isfinite(rows["tare"])]).all()
    np.testing.assert_array_equal(above[good], (rows["counts"] - rows["tare"].astype(float))[good])
    pressed = paf(rows, threshold_n=0.2)  # a 7 mm flat spreads its 5 N: Eq 4 finds little under any one electrode
    assert pressed["valid"].any() and not pressed["valid"].all()
    rows["counts"][:, 4] = INVALID_COUNT
    assert np.isnan(signals(rows)[:, 4]).all()
    with pytest.raises(InputError, match="rows have no tare: expected frames"):
        signals(rows[["counts", "pdc"]])
    with pytest.raises(InputError, match=r"\(3, 18\): expected frames"):
        signals(np.zeros((3, 18)))


def test_the_skin_s_coordinates() -> None:
    r = surface.RADIUS_MM
    at = skin(np.array([[-16.0, 0.0, -r], [0.0, 0.0, -r], [-4.0, r, 0.0], [-4.0, -r, 0.0]]))
    quarter = np.pi / 2 * r
    np.testing.assert_allclose(at, [[0, 0], [16, 0], [12, quarter], [12, -quarter]], atol=1e-9)


def test_the_issue_s_errors_under_mixed_loads() -> None:
    """RMSE d <= 2.3 mm and r <= 2.2 mm with the threshold, straight and tilted presses of all probes."""
    its = stimulate(Finger(1), (30, 30, 30, 30), seed=1, frames=12)
    found = paf(its.counts - its.tare)
    error = (found["dr_mm"] - skin(its.contact_mm))[found["valid"]]
    d, r = np.sqrt((error**2).mean(axis=0))
    assert d <= 2.3 and r <= 2.2
    light = np.linalg.norm(its.force_n, axis=1)[~found["valid"]]
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


def test_the_causal_taps_are_the_reference_s_and_follow_a_slope_without_lag() -> None:
    printed = [-0.006, -0.031, -0.058, -0.068, -0.049, 0.0, 0.071, 0.155, 0.243, 0.329, 0.413]  # numerics.md 5.2
    np.testing.assert_allclose(causal_taps(), printed, atol=6e-4)
    line = 0.3 * np.arange(40.0) - 2.0
    smooth = causal(line)
    assert np.isnan(smooth[:10]).all()
    np.testing.assert_allclose(smooth[10:], line[10:])
    assert causal(np.ones((12, 2))).shape == (12, 2)


def test_scores_by_hand() -> None:
    its = score([1.0, 2.0, 4.0], [1.0, 3.0, 5.0])
    assert its.rmse == pytest.approx(np.sqrt(2 / 3))
    assert its.smse == pytest.approx((2 / 3) / (8 / 3))
    assert its.r2 == pytest.approx(np.corrcoef([1, 2, 4], [1, 3, 5])[0, 1] ** 2)
    assert its.percent == pytest.approx(100.0 * (0.5 + 1.0) / (2.0 + 4.0))
    assert score([1.0, np.nan], [1.0, 2.0]).rows == 1
    assert np.isnan(score([1.0, 2.0], [0.0, 0.0]).percent)
    assert paf_room.STRONGEST == 3
