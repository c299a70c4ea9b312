"""The population map's error on a finger that it has not seen, as it is and with a little data of that finger."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np

from biotac import InputError
from biotac.calibrate.population import Population
from biotac.calibrate.press import Scale, scale_of, shrink_to
from biotac.calibrate.wrench import Run, rmse

from .training import Floats, sums

ROWS_PER_S = 100  # taken for all recordings: they need not have times
PRESSES = 5
DRAWS = 200
PRESS_ROWS = 75
STRAIGHT = 0.08  # of F_z: shear that a person pressing on a scale does not notice
FIRM_N = 1.5
APART_ROWS = 100
MINUTE_S = 60
MINUTES = 4  # number tried, each alone, spread over the recording
SIGMAS = (1.0, 2.0)
BANDS_N = (0.3, 1.0, 2.0, 3.0, 5.0, 7.0, np.inf)
LEAST_ROWS = 10  # of a band that is printed; fewer than some hundred come from one or two touches


@dataclass(frozen=True)
class Worth:
    """RMSE (3,) in N of the map as it is, after five straight presses, and after a minute on a plate.

    It is None where the run has no such presses or is too short. ``published_n`` (n, 3) is the force as boards publish
    it, ``map_n`` (n, 3) the map's alone, which presses correct, ``truth_n`` (n, 3) the plate's; ``scales`` are from the
    draws of presses.
    """

    rmse_n: Floats
    rmse_scale5_n: Floats | None
    rmse_60s_n: Floats | None
    published_n: Floats
    map_n: Floats
    truth_n: Floats
    scales: tuple[Scale, ...]


def worth(population: Population, run: Run) -> Worth:
    """The errors of a map on an aligned run of a new finger."""
    truth = run.truth
    published, by_map = population.published(run.counts, run.tare), population.force(run.counts, run.tare)
    scales, scale5 = _scaled(run.name, by_map, truth)
    return Worth(rmse(published, truth), scale5, _minute(population, run), published, by_map, truth, scales)


def sigma_of(left_out: Sequence[Worth]) -> tuple[Floats, Floats]:
    """One sigma (3,) in N of a new finger's force, as the map is and after five presses: that of held-out fingers.

    Where a run has no presses the former counts twice. The second sigma is never above the first: presses do not make
    a finger less known.
    """
    scaled = [found.rmse_n if found.rmse_scale5_n is None else found.rmse_scale5_n for found in left_out]
    raw, after = (np.sqrt(np.mean(np.square(each), axis=0)) for each in ([found.rmse_n for found in left_out], scaled))
    return raw, np.minimum(raw, after)


def by_band(found: Worth) -> list[list[Any]]:
    """By band of the true force: name, rows, bias along the true force in N and % of it, RMS of the error in N."""
    size = np.linalg.norm(found.truth_n, axis=1)
    error = found.published_n - found.truth_n
    along = (error * found.truth_n).sum(axis=1) / np.maximum(size, BANDS_N[0])
    result: list[list[Any]] = []
    for low, high in pairwise(BANDS_N):
        rows = (size >= low) & (size < high)
        if rows.sum() >= LEAST_ROWS:
            bias = along[rows].mean()
            name = f"{low:g} to {high:g}" if high < np.inf else f"above {low:g}"
            rms = np.sqrt((error[rows] ** 2).sum(axis=1).mean())
            result.append([name, int(rows.sum()), bias, 100.0 * bias / size[rows].mean(), rms])
    return result


def coverage(error_n: Floats, sigma_n: Floats) -> list[float]:
    """Shares of errors (n, 3) within one and two sigma (3,), all axes together."""
    return [float((np.abs(error_n) <= sigmas * sigma_n).mean()) for sigmas in SIGMAS]


def facts(found: Worth, sigma: tuple[Floats, Floats]) -> dict[str, Any]:
    """The errors and coverages as JSON types."""
    result: dict[str, Any] = {
        "rmse_n": found.rmse_n.tolist(),
        "rmse_scale5_n": None if found.rmse_scale5_n is None else found.rmse_scale5_n.tolist(),
        "rmse_60s_n": None if found.rmse_60s_n is None else found.rmse_60s_n.tolist(),
        "coverage": coverage(found.published_n - found.truth_n, sigma[0]),
    }
    if found.scales:
        each = [coverage(scale.applied(found.map_n) - found.truth_n, sigma[1]) for scale in found.scales]
        result["coverage_scale5"] = np.mean(each, axis=0).tolist()
    return result


def _scaled(name: str, felt_n: Floats, truth: Floats) -> tuple[tuple[Scale, ...], Floats | None]:
    """Scales from draws of five presses, each a firm and straight stretch of the run, and the RMSE with them."""
    ends = np.arange(PRESS_ROWS, len(truth) + 1)
    total = np.concatenate([np.zeros((1, 6)), np.cumsum(np.column_stack([felt_n, truth]), axis=0)])
    mean = (total[ends] - total[ends - PRESS_ROWS]) / PRESS_ROWS
    shear = np.hypot(mean[:, 3], mean[:, 4])
    good = np.flatnonzero((mean[:, 5] > FIRM_N) & (shear < STRAIGHT * mean[:, 5]))
    if (mean[good, 2] <= 0.0).any():
        raise InputError(
            f"{name}: the map of the others feels {mean[good, 2].min():.2f} N along z where it is pressed with over "
            f"{FIRM_N:g} N: expected above 0; check the sign and axes of F in its file and in theirs"
        )
    rng = np.random.default_rng(0)
    result = []
    for _ in range(DRAWS):
        chosen: list[int] = []
        for at in rng.permutation(good):
            if all(abs(int(at) - other) >= APART_ROWS for other in chosen):
                chosen.append(int(at))
            if len(chosen) == PRESSES:
                result.append(scale_of(mean[chosen, :3], mean[chosen, 3:] * [0.0, 0.0, 1.0]))
                break
        else:
            return (), None  # the run has no five presses
    each = [((scale.applied(felt_n) - truth) ** 2).mean(axis=0) for scale in result]
    return tuple(result), np.sqrt(np.mean(each, axis=0))


def _minute(population: Population, run: Run) -> Floats | None:
    """RMSE (3,) in N after a minute of the run, over rows at least a second away from it; None for less than two."""
    rows, n = MINUTE_S * ROWS_PER_S, len(run.counts)
    if n < 2 * rows:
        return None
    found = []
    for start in np.linspace(0, n - rows, MINUTES).astype(int):
        minute = slice(start, start + rows)
        part = replace(run, counts=run.counts[minute], truth=run.truth[minute])
        moved = shrink_to(population, sums(part), MINUTE_S)
        rest = np.r_[: max(start - ROWS_PER_S, 0), min(start + rows + ROWS_PER_S, n) : n]
        found.append(((moved.force(run.counts[rest], run.tare) - run.truth[rest]) ** 2).mean(axis=0))
    result: Floats = np.sqrt(np.mean(found, axis=0))
    return result
