"""A validation's figures: all errors are over held-out rows, rest_n() is of the final map."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from ...kernels.geometry import Floats
from ...map.columns import Signals, centroid_mm, columns, with_one
from .crossvalidation import SHIFTS_COUNTS, TRAINING_SHARES, Validation
from .models import LAMBDAS, LIN, POOL, POOLED
from .moments import moved
from .splits import BLOCKS

ROWS_PER_S = 100  # taken for all runs, which have no times
ANGLE_MIN_N = 0.5  # the direction of a smaller force means nothing
THIRDS = (0.0, 1.0 / 3.0, 2.0 / 3.0, 1.0)


def rmse(predicted: Floats, truth: Floats) -> Floats:
    """RMS error of each axis (axes,), in the truth's unit."""
    result: Floats = np.sqrt(((predicted - truth) ** 2).mean(axis=0))
    return result


def r2(predicted: Floats, truth: Floats) -> Floats:
    """R2 of each axis (axes,): 1 is perfect, 0 no better than the mean; NaN where the truth never changes."""
    variance = truth.var(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        result: Floats = np.where(variance > 0.0, 1.0 - ((predicted - truth) ** 2).mean(axis=0) / variance, np.nan)
    return result


def median_angle_deg(predicted: Floats, truth: Floats) -> float:
    """Median angle between predicted and true force, over rows with at least ANGLE_MIN_N; NaN if there are none."""
    size = np.linalg.norm(truth[:, :3], axis=1)
    firm = size >= ANGLE_MIN_N
    if not firm.any():
        return float("nan")
    return float(np.median(angles_deg(predicted[firm, :3], truth[firm, :3])))


def angles_deg(a: Floats, b: Floats) -> Floats:
    """Angles (k,) between the rows of two (k, 3)."""
    # atan2 is exact for small angles, which acos rounds to 0
    angles: Floats = np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1)))
    return angles


def confusion(predicted: Floats, truth: Floats) -> Floats:
    """Matrix (axes, axes) of how much of true axis j appears on predicted axis i; the identity is perfect.

    It is a least-squares fit of the prediction to all true axes and an offset, so that axes which are merely correlated
    in this run do not appear as confused.
    """
    basis = np.column_stack([truth, np.ones(len(truth))])
    found: Floats = np.linalg.lstsq(basis, predicted, rcond=None)[0][:-1].T
    return found


def regions(validation: Validation) -> list[dict[str, Any]]:
    """RMS length of the force error by the place of the compression's centroid, ``x_mm`` and ``y_mm``, worst first.

    Regions are thirds along times thirds across of the run's own contacts; those with under 1 % of the rows in contact
    are left out.
    """
    run, final = validation.run, validation.final
    centre = centroid_mm(moved(run.counts, -int(np.median(final.lag_rows))) - run.tare)
    error = ((validation.predicted[0][:, :3] - run.truth[:, :3]) ** 2).sum(axis=1)
    touched = ~run.rest
    edges = [np.quantile(centre[touched, axis], THIRDS) for axis in (0, 1)]
    result = []
    for thirds in product(range(3), repeat=2):
        here, bounds = touched.copy(), []
        for values, edge, k in zip(centre.T, edges, thirds, strict=False):
            here &= (values >= edge[k]) & ((values <= edge[k + 1]) if k == 2 else (values < edge[k + 1]))
            bounds.append((float(edge[k]), float(edge[k + 1])))
        if here.sum() >= 0.01 * touched.sum():
            rmse_n = float(np.sqrt(error[here].mean()))
            result.append({"x_mm": bounds[0], "y_mm": bounds[1], "rows": int(here.sum()), "rmse_n": rmse_n})
    return sorted(result, key=lambda region: -region["rmse_n"])


def minutes(validation: Validation) -> list[dict[str, Any]]:
    """Error against the amount of training: ``minutes`` at ROWS_PER_S, and the held-out ``rmse`` of each axis."""
    rows = len(validation.run.truth) * (BLOCKS - 1) / BLOCKS
    whole = rmse(validation.predicted[0], validation.run.truth)
    steps = [*zip(TRAINING_SHARES, validation.less, strict=True), (1.0, whole)]
    return [{"minutes": part * rows / ROWS_PER_S / 60.0, "rmse": _list(error)} for part, error in steps]


def next_minute(validation: Validation) -> dict[str, Any]:
    """The region where a further minute helps most: that of regions(), with ``gain_n``, the decrease of the error.

    A region's error is assumed to fall with the region's rows as the whole run's does with all rows. It is an estimate,
    good enough to choose by.
    """
    full = np.linalg.norm(rmse(validation.predicted[0], validation.run.truth)[:3])
    before = np.linalg.norm(validation.less[-1][:3])
    power = max(float(np.log(before / full) / np.log(1.0 / TRAINING_SHARES[-1])), 0.0)
    result = []
    for region in regions(validation):
        share = region["rows"] / (region["rows"] + 60 * ROWS_PER_S)
        result.append(region | {"gain_n": region["rmse_n"] * (1.0 - share**power)})
    return max(result, key=lambda region: region["gain_n"])


def weights(validation: Validation) -> tuple[list[dict[str, float]], list[float]]:
    """For each axis, means over the folds: each model's weight in the pool, and the part pulled to other fingers."""
    mean = np.mean([fit.weights for fit in validation.folds], axis=0)
    by_model = mean.reshape(len(mean), -1, len(POOL), len(LAMBDAS)).sum(axis=(1, 3))
    named = [{model.name: float(share) for model, share in zip(POOL, shares, strict=True)} for shares in by_model]
    return named, mean[:, len(POOL) * len(LAMBDAS) :].sum(axis=1).tolist()


def summary(validation: Validation) -> dict[str, Any]:
    """All figures as JSON types; forces in N, torques in N mm, in the order of ``axes``."""
    run, truth, predicted = validation.run, validation.run.truth, validation.predicted
    lin = validation.by_model[LIN][0]
    errors = [rmse(p, truth) for p in predicted]
    by_model, pulled = weights(validation)
    result: dict[str, Any] = {
        "file": run.name,
        "rows": len(truth),
        "model": POOLED,
        "axes": list(run.axes),
        "rmse_n": _list(errors[0][:3]),
        "r2": _list(r2(predicted[0], truth)),
        "median_angle_deg": median_angle_deg(predicted[0], truth),
        "drift_counts": list(SHIFTS_COUNTS[1:]),
        "drift_rmse_n": [_list(shifted[:3]) for shifted in errors[1:]],
        "better_than_lin": _list(lin / np.maximum(errors[0], 1e-12)),
        "rest_n": rest_n(validation),
        "air_share": validation.final.air_share,
        "lag_rows": validation.lag_rows,
        "lag_corrected_rows": list(validation.final.lag_rows),
        "window_rows": validation.final.window_rows,
        "affine_r2": validation.affine_r2,
        "weights": dict(zip(run.axes, by_model, strict=True)),
        "pulled_to_others": dict(zip(run.axes, pulled, strict=True)),
        "models": {name: _list(each[0]) for name, each in validation.by_model.items()},
        "models_drifted": {name: _list(each[1:].max(axis=0)) for name, each in validation.by_model.items()},
        "confusion": [_list(row) for row in confusion(predicted[0], truth)],
        "worst_region": regions(validation)[0],
        "minutes": minutes(validation),
        "next_minute": next_minute(validation),
        "contact_edges": validation.blocks.whole_contacts,
        "contacts": validation.blocks.contacts,
        "notes": list(run.notes),
    }
    if len(run.axes) > 3:
        result["rmse_nmm"] = _list(errors[0][3:6])
        # only two electrodes at the tip sense it, with a lever of a millimetre and a half
        result["notes"].append(
            "Mx cannot be measured with this electrode layout: its figures come from what correlates with it"
        )
    if len(run.axes) > 6:
        result["torsion_rmse_nmm"] = float(errors[0][6])
    return result


def rest_n(validation: Validation) -> list[float]:
    """Size of the force in N that the final map gives where nothing touches: at e = 0, then at SHIFTS_COUNTS[1:]."""
    run, final = validation.run, validation.final
    still = np.zeros((1, len(run.tare)))
    pdc = None if run.pdc is None else np.zeros(1)
    wrenches = [
        with_one(columns(Signals(still + counts * run.drift, run.tare, pdc))) @ final.best for counts in SHIFTS_COUNTS
    ]
    return [float(np.linalg.norm(wrench[0, :3])) for wrench in wrenches]


def _list(values: Floats) -> list[float | None]:
    # JSON has no NaN
    return [float(value) if np.isfinite(value) else None for value in values]
