"""95 % intervals of normal and shear on real frames that the force's source had not seen (`biotac-lab interval`)."""

from pathlib import Path

import numpy as np
import pytest

from biotac.calibrate.wrench import load
from biotac.kernels.geometry import RADIUS_MM, grip_parts
from biotac.map import Margin, fit_margin, published_parts
from biotac_lab.calibrate import interval
from biotac_lab.calibrate.interval import Judged, together
from biotac_lab.calibrate.training import of_others

ALL, BAND, OVER_RMS, OUT = (0.90, 0.99), (0.80, 0.995), 3.0, 0.90


@pytest.fixture(scope="module")
def fingers(shared_data: Path) -> list[interval.Finger]:
    paths = [shared_data / f"syntouchcontact/{name}.npz" for name in ("F1", "F2")]
    return [interval.Finger.of_run(load(path).run) for path in paths]


def misses(judged: Judged) -> list[tuple]:
    """The lines of a table that are not within the limits; there are as many bands as the recordings have."""
    lines = list(judged.touched().lines())
    assert sum(band == "all" for _, band, *_ in lines) == 2 and len(lines) >= 2 * 5
    return [
        line
        for line in lines
        for low, high in [ALL if line[1] == "all" else BAND]
        if not (low <= line[3] <= high and (line[1] == "all" or line[5] <= OVER_RMS))
    ]


@pytest.mark.nightly
def test_frames_of_another_real_finger_are_within_the_intervals_of_population_and_lin(fingers) -> None:
    first, other = fingers
    _, by_population = interval.population_margin(
        fingers, of_others([finger.sums for finger in fingers], symmetric=True)
    )
    assert misses(together(by_population)) == []
    published = [interval.with_unfelt(finger, each) for finger, each in zip(fingers, by_population, strict=True)]
    assert [
        line for line in together(published).touched().lines() if line[3] < (ALL if line[1] == "all" else BAND)[0]
    ] == []
    assert misses(together([interval.lin_rows(first, [other]), interval.lin_rows(other, [first])])) == []


@pytest.mark.nightly  # by day tests/host/calibrate fits a real finger's own map, and the test above judges intervals
@pytest.mark.parametrize("index", [0, 1])
def test_left_out_frames_of_a_real_finger_are_within_the_intervals_of_an_own_map(fingers, index: int) -> None:
    finger, rest = fingers[index], fingers[1 - index]
    whole, crossed, own_map = interval.own_rows(finger)
    assert misses(whole) == []
    # by a margin of every other block, 12 s each: over all; a band's few stretches may be all in the other half
    assert [line for line in crossed.touched().lines() if line[1] == "all" and not ALL[0] <= line[3] <= ALL[1]] == []
    for given in (({}, own_map), ({}, None), (interval.lin_settings([rest]), None)):
        assert min(interval.share_without_electrode(finger, *given)) >= OUT


def test_a_margin_is_the_narrowest_that_holds_what_it_is_fitted_to() -> None:
    rng = np.random.default_rng(1)
    poc_mm = np.tile([-4.0, 0.0, -RADIUS_MM], (20_000, 1))
    force_n = np.column_stack([rng.uniform(-1, 1, 20_000), rng.uniform(-1, 1, 20_000), rng.uniform(0.4, 9, 20_000)])
    truth = grip_parts(force_n, poc_mm)
    assert np.allclose(truth[:, 0], force_n[:, 2]) and np.allclose(truth[:, 1], np.hypot(*force_n[:, :2].T))
    pull = published_parts(-force_n, poc_mm)
    assert (pull[:, 0] == 0).all() and np.allclose(pull[:, 1], truth[:, 1])
    noise = rng.normal(size=truth.shape)
    alike = fit_margin(truth + 0.2 * noise, truth, force_n)  # 2.05 sigma hold 96 %
    assert max(alike.share_q8) <= 8 and np.allclose(alike.half_n(truth).mean(axis=0), 0.411, rtol=0.05)
    growing = truth + 0.1 * truth.sum(axis=1, keepdims=True) * noise
    half = fit_margin(growing, truth, force_n).half_n(growing)
    assert np.all(np.abs((np.abs(growing - truth) <= half).mean(axis=0) - 0.96) < 0.01)
    assert half[force_n[:, 2] > 7].mean() > 3 * half[force_n[:, 2] < 2].mean()
    few = fit_margin(truth[:100], truth[:100], force_n[:100])
    assert few == Margin((65535, 65535), (0, 0)) and np.isnan(few.half_n(truth[:3])).all()
