"""Parts of Lin 2013 that no board has: any exponent, the paper's own tare, figure 8; and the default weights."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import biotac
from biotac.core import geometry
from biotac_lab.cli import main
from biotac_lab.experiments import lin_tare, poke, poke_wrench, tare


@pytest.mark.parametrize(("weights", "n", "compressed"), [("ABS_N2", 2.0, False), ("COMPRESS_N1", 1.0, True)])
def test_exponents_that_a_board_has_give_its_formulas(weights: str, n: float, compressed: bool) -> None:
    rng = np.random.default_rng(1)
    counts = rng.integers(0, 4096, (500, 19)).astype(np.uint16)
    above = counts - 2000.0
    above[3] = 0.0
    counts[3] = 2000
    settings = {biotac.Setting.POC_WEIGHTS: int(biotac.PocWeights[weights])}
    known = biotac.compute(counts, np.full(19, 2000.0), settings)["poc_mm"]
    found = geometry.point_of_contact(above, n, compressed=compressed)
    np.testing.assert_allclose(found, known, atol=1e-12)
    assert np.isnan(found[3]).all()


def test_any_exponent() -> None:
    two = np.zeros((1, 19))
    two[0, [16, 17]] = -300.0, -100.0  # E17 and E18, both on the midline: x says it all
    x = geometry.ELECTRODE_MM[[16, 17], 0]
    for n in (0.25, 3.0, 7.5):
        share = 1.0 / (1.0 + 3.0**-n)
        assert geometry.point_of_contact(two, n)[0, 0] == pytest.approx(share * x[0] + (1 - share) * x[1])
    for n in (1e6, np.inf):
        assert geometry.point_of_contact(two, n)[0, 0] == pytest.approx(x[0])
    with pytest.raises(ValueError, match=r"exponent 0.0: expected \(n, 19\) and more than 0"):
        geometry.point_of_contact(two, 0.0)


def course(levels: np.ndarray) -> np.ndarray:
    """Counts (n, 19) with one electrode so far below 3000."""
    counts = np.full((len(levels), 19), 3000.0)
    counts[:, 16] -= levels
    return counts


def test_the_paper_s_tare_zeroes_what_is_slow_and_is_locked_out_by_what_is_fast() -> None:
    slow, fast = np.arange(400) * 2.0, np.repeat([0.0, 600.0], 200)
    for reading in lin_tare.READINGS[:2]:
        held, is_new = lin_tare.renormalised(course(np.r_[np.zeros(20), slow]), reading)
        # a mean over ten rows of a ramp of two counts a row is nine counts behind
        assert held[-1, 16] == pytest.approx(3000.0 - slow[-1] + 9.0)
        assert is_new.sum() == (42 if reading == lin_tare.READINGS[0] else 411)
    # a signal that moves by 4 counts a row is 40 counts a window, and 4 a window that ends in the next row
    for reading, follows in zip(lin_tare.READINGS, (False, True, True), strict=True):
        held, _ = lin_tare.renormalised(course(np.r_[np.zeros(20), 2.0 * slow]), reading)
        assert (held[-1, 16] < 2000.0) == follows, reading
    held, is_new = lin_tare.renormalised(course(fast))
    assert (held[220:, 16] == 3000.0).all() and not is_new[220:].any()
    # 40 counts that stay after it are above the threshold, 31 are not
    for left, locked in ((40.0, True), (31.0, False)):
        held, _ = lin_tare.renormalised(course(np.r_[fast, np.full(100, left)]))
        assert (held[-1, 16] == 3000.0) == locked
    held, _ = lin_tare.renormalised(course(fast), lin_tare.READINGS[2])
    assert held[-1, 16] == 2400.0, "a load that is held is zeroed"
    assert np.isnan(held[: lin_tare.WINDOW_ROWS - 1]).all()


def test_a_slow_load_is_kept_by_the_board_and_by_one_reading_of_the_paper() -> None:
    trial = tare.slow_load(2, "new", 2.0)
    rest, rows = tare.at_rest(trial, 2, "new"), trial.during(trial.phases[1])
    true = tare.size(trial.counts - rest)[rows].mean()
    kept = {way: tare.size(trial.counts - held)[rows].mean() / true for way, (held, _) in tare.tares(trial).items()}
    keep = (tare.BOARD, tare.WAYS[0])
    assert all(kept[way] == pytest.approx(1.0, abs=0.02) for way in keep)
    assert all(share < 0.05 for way, share in kept.items() if way not in keep)


@pytest.mark.nightly
def test_slow_loads_lock_out_and_drift() -> None:
    assert main(["experiment", "tare", "--check"]) == 0


def test_figure_8_on_a_finger_that_is_as_the_paper_says() -> None:
    trial = poke.emulated(1, "new")
    contacts = poke.contacts(trial)
    signal = np.nan_to_num(trial.signal)
    arms = np.cross(geometry.ELECTRODE_MM, geometry.ELECTRODE_NORMAL)
    like_paper = replace(
        trial,
        force_n=signal @ geometry.ELECTRODE_NORMAL * [1e-3, 2e-3, 3e-3],
        torque_nmm=signal @ arms * [0.0, 7e-4, 3e-4],
    )
    rows = {row[1]: row for row in poke_wrench.table({"new": like_paper}, {"new": contacts}).rows}
    for axis in ("Fx [N]", "Fy [N]", "Fz [N]", "My [N mm]", "Mz [N mm]"):
        assert rows[axis][3] < 3e-3 and rows[axis][5] > 0.999, axis
    real = {row[1]: row for row in poke_wrench.table({"new": trial}, {"new": contacts}).rows}
    assert real["Fz [N]"][3] > 0.1 and real["Mx [N mm]"][5] is None  # a poke's force meets the axis


def test_the_default_weights_are_good_in_pokes_and_on_the_plate(shared_data: Path, capsys) -> None:
    path = shared_data / "robotic_finger" / "trial_15330.npz"
    assert main(["experiment", "weights", str(path), "--check", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [round(check["limit"], 2) for check in facts["checks"]] == [0.36, 9.57]
    rows = {row[0]: row for row in facts["tables"][0]["rows"]}
    assert len(rows) == 11 and sum("(default)" in name for name in rows) == 1
