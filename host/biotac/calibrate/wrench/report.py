"""A validation as a page of Markdown and a picture; every number in it is computed from the validation."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...markdown import table
from . import figures
from .crossvalidation import INNER_FOLDS, SHIFTS_COUNTS, Validation
from .lag import MAX_LAG_ROWS
from .models import POOLED, TEXTS
from .splits import BLOCKS, GUARD_ROWS

AXIS_COLORS = ("#c2410c", "#15803d", "#1d4ed8")
MAX_DOTS = 4000  # per axis; more would only make the file larger


def markdown(validation: Validation, picture: str) -> str:
    """The page; ``picture`` is the picture's file name."""
    facts = figures.summary(validation)
    run = validation.run
    lags = ", ".join(f"{axis} {lag}" for axis, lag in zip(run.axes, validation.final.lag_rows, strict=True))
    cut, spans = _blocks(validation)
    by_shift = [figures.rmse(predicted, run.truth) for predicted in validation.predicted]
    explained, weights = figures.r2(validation.predicted[0], run.truth), facts["weights"].values()
    axes = []
    for k, (name, by_model) in enumerate(zip(run.axes, weights, strict=True)):
        errors = [f"{error[k]:.3f} {_unit(name)}" for error in by_shift]
        spread = f"{run.truth[:, k].std():.3f} {_unit(name)}"
        chosen = ", ".join(f"{model} {weight:.2f}" for model, weight in by_model.items())
        axes.append([name, *errors, f"{explained[k]:.3f}", spread, chosen])
    at_drifts = [f"at {counts:+.0f} counts" for counts in SHIFTS_COUNTS[1:]]
    drifts = " and ".join(f"{counts:+.0f}" for counts in SHIFTS_COUNTS[1:])
    still, *drifted = (f"{newton:.3f} N" for newton in facts["rest_n"])
    air = f"E_base is trained on with force 0, {facts['air_share']:.1%} of the run's weight"
    if run.air is None:
        air = "there is no E_base, so only the run itself shows what no contact is"
    models = []
    for name, errors in facts["models"].items():
        cells = [f"{a:.3f} ({b:.3f})" for a, b in zip(errors, facts["models_drifted"][name], strict=True)]
        models.append([name, *cells, TEXTS[name]])
    shares = [[f"{value:+.3f}" for value in row] for row in facts["confusion"]]
    lines = [
        f"# Wrench calibration of {run.name}",
        "",
        f"{facts['rows']} rows, {cut}; lags, smoothing and the models' weights are chosen within the "
        f"other blocks ({INNER_FOLDS} folds of whole blocks). "
        "Frame: x to the tip, y to E11's side, z dorsal; force on the finger.",
        "",
        f"The map is the models' weighted mean; median angle {facts['median_angle_deg']:.2f} deg.",
        "",
        *table(["axis", "RMSE", *at_drifts, "R2", "standard deviation of the truth", "model weights"], axes),
        "## Models",
        "",
        f"Held-out RMSE; in brackets, the worse of {drifts} counts of untared drift.",
        "",
        *table(["model", *[f"{axis} [{_unit(axis)}]" for axis in run.axes], ""], models),
        "## Weak places",
        "",
        *_weak(validation, facts),
        "",
        "## Confusion of axes",
        "",
        "How much of each true axis appears on each predicted one; 1 on the diagonal and 0 elsewhere is perfect.",
        "",
        *table(
            ["", *[f"true {name}" for name in run.axes]],
            [[f"predicted {name}", *row] for name, row in zip(run.axes, shares, strict=True)],
        ),
        "## Assumptions",
        "",
        f"* force and counts: counts lag by {facts['lag_rows']} rows (at most {MAX_LAG_ROWS} allowed), corrected per "
        f"axis: {lags}; an affine map reaches a held-out R2 of {facts['affine_r2']:.2f}",
        f"* the map is evaluated on counts averaged over {facts['window_rows']} frames",
        f"* without contact the map gives {still}, and {' and '.join(drifted)} at {drifts} counts of drift; {air}",
        *[f"* {note}" for note in facts["notes"]],
        *spans,
        "",
        f"![prediction against truth, held out]({picture})",
        "",
    ]
    return "\n".join(lines)


def draw(validation: Validation, figure: Any) -> None:
    """Draw prediction against truth for each force axis, and the models' errors, in a matplotlib figure."""
    figure.set_size_inches(16, 4.4)
    figure.suptitle(f"{validation.run.name}: {POOLED}, held out")
    *panels, models = figure.subplots(1, 4)
    forces = zip(panels, validation.run.axes, validation.run.truth.T, validation.predicted[0].T, strict=False)
    for color, (axes, name, truth, guess) in zip(AXIS_COLORS, forces, strict=True):
        step = max(1, len(truth) // MAX_DOTS)
        axes.plot(truth[::step], guess[::step], ".", color=color, markersize=2, alpha=0.5)
        ends = [float(truth.min()), float(truth.max())]
        axes.plot(ends, ends, color="#444444", linewidth=1)
        axes.set(xlabel=f"true {name} [N]", ylabel=f"predicted {name} [N]")
        error = figures.rmse(guess[:, None], truth[:, None])[0]
        axes.set_title(f"{name}: RMSE {error:.3f} N", fontsize=10)
        axes.grid(alpha=0.3)
    _draw_models(models, validation)


def _blocks(validation: Validation) -> tuple[str, list[str]]:
    """How the run is cut into blocks, and a sentence about contacts that span two."""
    blocks = validation.blocks
    if blocks.by_contact:
        return f"{blocks.contacts} contacts split into {BLOCKS} blocks, each held out once", []
    cut = f"{BLOCKS} contiguous blocks, each held out once with {GUARD_ROWS} guard rows on both sides"
    if not validation.run.rest.any():
        return cut, ["* the run never rests: blocks are cut anywhere, so a long contact may span two"]
    return cut, [f"* block edges at rest, so that no contact spans two blocks: {blocks.whole_contacts}"]


def _unit(axis: str) -> str:
    return "N" if axis.startswith("F") else "N mm"


def _weak(validation: Validation, facts: dict[str, Any]) -> list[str]:
    found = figures.regions(validation)
    worst, best = found[0], found[-1]
    gain = ", ".join(f"{axis} {g:.1f}" for axis, g in zip(validation.run.axes, facts["better_than_lin"], strict=True))
    curve = "; ".join(
        f"{row['minutes']:.1f} min " + "/".join(f"{error:.3f}" for error in row["rmse"][:3]) for row in facts["minutes"]
    )
    x, y = facts["next_minute"]["x_mm"], facts["next_minute"]["y_mm"]
    r2 = facts["r2"]
    axis = min(range(len(r2)), key=lambda k: np.inf if r2[k] is None else r2[k])
    lines = [
        f"* weakest axis: {validation.run.axes[axis]}" + ("" if r2[axis] is None else f", R2 {r2[axis]:.3f}"),
        f"* worst region: compression centred at x {worst['x_mm'][0]:.1f} to {worst['x_mm'][1]:.1f} mm, "
        f"y {worst['y_mm'][0]:.1f} to {worst['y_mm'][1]:.1f} mm ({worst['rows']} rows): RMS length of "
        f"the error {worst['rmse_n']:.3f} N; best region {best['rmse_n']:.3f} N",
        f"* factor by which it is better than Lin's three scales: {gain}",
        f"* error along x/y/z in N by minutes of training data (100 rows per second): {curve}",
        f"* another minute helps most where the compression is centred at x {x[0]:.1f} to {x[1]:.1f} mm, "
        f"y {y[0]:.1f} to {y[1]:.1f} mm: it would cut the error by about {facts['next_minute']['gain_n']:.2f} N",
    ]
    blocks = [validation.blocks.rows(k) for k in range(BLOCKS)]
    errors = np.array([figures.rmse(validation.predicted[0][r], validation.run.truth[r]) for r in blocks])
    for name, axis_errors in zip(validation.run.axes, errors.T, strict=True):
        worst_block = int(np.argmax(axis_errors))
        error = f"{axis_errors[worst_block]:.3f} {_unit(name)}"
        lines.append(f"* {name}: worst block {worst_block + 1} of {BLOCKS}, RMSE {error}")
    return lines


def _draw_models(axes: Any, validation: Validation) -> None:
    from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

    names = list(validation.by_model)
    rows = np.arange(len(names))
    for axis in range(3):
        errors = [validation.by_model[name][0][axis] for name in names]
        drifted = [validation.by_model[name][1:, axis].max() for name in names]
        at = rows + (axis - 1) * 0.26
        axes.barh(at, errors, height=0.24, color=AXIS_COLORS[axis], label=validation.run.axes[axis])
        axes.plot(drifted, at, "|", color="#111111", markersize=6, label="drifted" if axis == 2 else None)
    axes.set_yticks(rows, names, fontsize=8)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter(FormatStrFormatter("%g"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set(xlabel="held-out RMSE [N]")
    axes.invert_yaxis()
    axes.grid(alpha=0.3, axis="x")
    axes.legend(fontsize=8)
