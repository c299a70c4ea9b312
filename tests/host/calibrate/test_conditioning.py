"""Loads that cannot determine a fit: each is refused, or the report says which part is unknown."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import wrench_run

from biotac.calibrate.press import few_shot, pressure
from biotac.calibrate.wrench import models, moments
from biotac.calibrate.wrench.plate_recording import MAX_CONDITION, NOTED_CONDITION, check_loads, load_run
from biotac.errors import InputError

ROWS = np.random.default_rng(5).normal(size=(500, 3))


def along(*ways: tuple[float, float, float]) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """Only the part of a recording's force along these vectors, of length 1 and at right angles."""
    return lambda a: {"F": sum(np.outer(a["F"] @ np.array(way), way) for way in ways).astype(np.float32)}


@pytest.mark.parametrize(
    ("change", "where"),
    [
        (along((0.6, 0.0, -0.8)), "on one line"),
        (along((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)), "in one plane"),
        (along((0.0, 0.6, -0.8), (1.0, 0.0, 0.0)), "in one plane"),
    ],
)
def test_a_wrench_map_needs_forces_in_every_direction(change, where: str, tmp_path: Path) -> None:
    arrays = wrench_run.fields(4000)
    with pytest.raises(InputError, match=rf"the forces lie {where}: condition number of the forces [\d.e+]+"):
        load_run(wrench_run.save(tmp_path / "run.npz", arrays | change(arrays)))


def test_the_condition_number_is_that_of_the_known_spread() -> None:
    """Independent axes of known spread: 1, 1 and 1/c around any mean."""
    for condition in (0.5 * NOTED_CONDITION, 2.0 * NOTED_CONDITION, 2.0 * MAX_CONDITION):
        q, _ = np.linalg.qr(ROWS - ROWS.mean(axis=0))
        force = q * [1.0, 1.0 / condition, 1.0] * 40.0 + [3.0, -2.0, 50.0]
        if condition > MAX_CONDITION:
            with pytest.raises(InputError, match=r"number of the forces 2e\+03, .* least along .*1\.00"):
                check_loads("here", force)
        else:
            notes = check_loads("here", force)
            assert len(notes) == (condition > NOTED_CONDITION)
            assert all(f"condition number of the forces {condition:.3g}, they vary least along" in n for n in notes)


def test_columns_that_are_the_same_share_what_they_say() -> None:
    """A ridge's answer to two electrodes that move together is finite, and the same for both."""
    z = np.column_stack([ROWS[:, 0], ROWS[:, 0], ROWS[:, 1], np.ones(len(ROWS))])
    truth = np.column_stack([2.0 * ROWS[:, 0] + 5.0, ROWS[:, 1]])
    found = models.solve(moments.WeightedSums(z.T @ z, z.T @ truth, (truth**2).sum(axis=0)), 1e-6)
    assert found[0] == pytest.approx(found[1], abs=1e-9)
    np.testing.assert_allclose(z @ found, truth, atol=1e-3)


def test_a_columns_spread_survives_a_mean_ten_thousand_times_as_large() -> None:
    """Sums take one pass: subtracting the mean costs the variance eight of sixteen digits."""
    z = np.column_stack([1e4 + ROWS[:, 0], ROWS[:, 1], np.ones(len(ROWS))])
    truth = 3.0 * ROWS[:, :1] - ROWS[:, 1:2] + 7.0
    found = models.solve(moments.WeightedSums(z.T @ z, z.T @ truth, (truth**2).sum(axis=0)), 1e-9)
    np.testing.assert_allclose(found[:2, 0], [3.0, -1.0], atol=1e-5)


@pytest.mark.parametrize("presses", [1, 5])
def test_presses_all_alike_leave_what_they_do_not_show_at_its_prior(presses: int) -> None:
    """Presses straight down show nothing of shear: the fit keeps the prior there, and the sigma of all fingers."""
    felt, force = np.tile([0.0, 0.0, 4.0], (presses, 1)), np.tile([0.0, 0.0, 6.0], (presses, 1))
    mixing, sigma = few_shot._mixing(felt, force, few_shot.WEIGHTS)
    assert few_shot.WEIGHTS.spread is not None
    np.testing.assert_array_equal(mixing[:2], np.eye(3)[:2])
    np.testing.assert_allclose(sigma[:2], few_shot.WEIGHTS.spread[:2])
    assert 1.0 < mixing[2, 2] < 1.5 and sigma[2, 2] < few_shot.WEIGHTS.spread[2, 2]


def test_pressures_gain_needs_a_pressure() -> None:
    """Eq 6 has one number: presses of one force determine it, and without pressure nothing does."""
    assert pressure.gain_of(np.full(30, 20.0), np.full(30, 5.0)) == pytest.approx(0.25)
    assert pressure.gain_of(np.zeros(30), np.full(30, 5.0)) == 0.0 < pressure.GAIN_MIN_N  # which fit() refuses
    with pytest.raises(InputError, match="0 presses, expected at least"):
        pressure.fit(None, [])  # type: ignore[arg-type]
