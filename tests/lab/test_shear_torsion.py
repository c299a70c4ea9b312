"""Shear and torsion at once: a calibrated map against the paper's formulas on a finger with known loads."""

from pathlib import Path

import numpy as np
import pytest

from biotac.calibrate.wrench import rmse
from biotac.core import geometry as surface
from biotac.sim import random_loads
from biotac_lab.experiments import shear_torsion
from biotac_lab.report import Options, write

FRAMES = 4000
pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module")
def result() -> shear_torsion.Result:
    return shear_torsion.measure(Options(seed=3), FRAMES)


def test_a_row_of_its_own_beats_taking_the_lever_away(result: shear_torsion.Result) -> None:
    predicted, both = result.validation.predicted[0], result.both
    truth = result.validation.run.truth
    own = rmse(predicted[both, 6:], truth[both, 6:])[0]
    # even at the true contact, which no map knows
    states = random_loads(FRAMES, 3)[0]
    normal = surface.normals_at(states.contact_mm)
    lever = ((predicted[:, 3:6] - np.cross(states.contact_mm, predicted[:, :3])) * normal).sum(axis=1)
    assert own < 0.5 * rmse(lever[both, None], truth[both, 6:])[0]


def test_shear_and_torsion_at_once(result: shear_torsion.Result, tmp_path: Path) -> None:
    report = shear_torsion.run(Options(seed=3), result)
    assert len(report.checks) == 5
    assert all(check["met"] for check in report.checks), report.checks
    (drawn,) = [path for path in write(report, tmp_path, "both", "", overwrite=False) if path.suffix == ".png"]
    assert drawn.read_bytes().startswith(b"\x89PNG")


def test_the_papers_model_is_given_its_due(result: shear_torsion.Result) -> None:
    run = result.validation.run
    # no scale could be better in sample, and held out it is hardly worse
    sums = (run.counts - run.tare) @ surface.ELECTRODE_NORMAL
    best = (sums * run.truth[:, :3]).sum(axis=0) / (sums**2).sum(axis=0)
    in_sample = rmse(sums * best, run.truth[:, :3])
    held_out = rmse(result.paper[:, :3], run.truth[:, :3])
    assert (held_out >= in_sample).all()
    np.testing.assert_allclose(held_out, in_sample, rtol=0.02)


def test_a_tare_that_follows_the_thermometer_is_all_a_map_needs(result: shear_torsion.Result) -> None:
    ways = list(result.warm.values())
    still, stays, default, own, tared = (way[[1, 2, 6]] for way in ways)
    # Fx: without it, eight degrees are seen as force
    assert (stays > 1.05 * still).all()
    # tared at each temperature no effect is left, so no term in the map could gain more
    np.testing.assert_allclose(tared, still, rtol=0.05)
    assert (default < 1.15 * still).all()
    assert (own < 1.15 * still).all()
