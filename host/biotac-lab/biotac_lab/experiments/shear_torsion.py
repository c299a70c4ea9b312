"""Shear and torsion at once: how well a calibrated map and the paper's formulas estimate them.

Lin, Fishel and Loeb 2013 call the two "substantially convolved" (figure 10). Here an emulated finger is pressed,
sheared and twisted at random over the pad, and calibrated with the code of ``biotac calibrate wrench``, with contact
locations held out. Then it is warmed and cooled, and put through figure 10's trial, which was not in training.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from biotac import Setting
from biotac.calibrate.wrench import Validation, load_run, rmse, validate
from biotac.core import geometry as surface
from biotac.map import WrenchMap, dumps_fitted
from biotac.sim import SimFinger, States, plate_recording, random_loads, tdc_counts
from biotac.wire import messages

from ..report import Options, Report, Table, check
from . import torsion_shear, weight
from .estimates import torsion
from .trial import Bools, Floats

FRAMES = 9000
FY, TORSION = 1, 6
PAPER, CALIBRATED = "paper", "calibrated"
FY_LIMIT, TORSION_LIMIT = 0.4, 0.6  # of the paper's RMSE
REST_CELSIUS, WARM_C = 30.0, 8.0


@dataclass(frozen=True)
class Result:
    """A calibration with all trials.

    ``validation`` is of the random loads; ``both`` (n,) marks those with shear and torsion at once. ``paper`` (n, 7) is
    Lin's Eq 3 and 4 on them, with six scales fitted without the row's own block. ``warm`` maps each way to handle
    temperature to an RMSE (7,) over ``both``. ``replayed`` is figure 10's trial by the paper's model and by the map.
    """

    validation: Validation
    both: Bools
    paper: Floats
    warm: dict[str, Floats]
    replayed: weight.Result


def measure(options: Options, frames: int = FRAMES) -> Result:
    """Calibrate and test the emulated finger of the options' seed."""
    finger = SimFinger(options.seed)
    loads, cell = random_loads(frames, options.seed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"emulated-{options.seed}.npz"
        np.savez(path, **plate_recording(finger, loads, cell, options.seed))
        validation = validate(load_run(path), show=options.show)
        fitted = Path(folder) / f"{CALIBRATED}.wrench.json"
        fitted.write_text(dumps_fitted(validation.wrench_map), encoding="utf-8")
        replayed = torsion_shear.measure(replace(options, maps=(fitted,)))
    both = np.asarray((np.linalg.norm(loads.shear_n, axis=1) > 0.0) & (loads.torsion_nmm != 0.0))
    warm = _warm(finger, loads, both, validation, options.seed)
    return Result(validation, both, _paper(validation), warm, replayed)


def run(options: Options, result: Result | None = None) -> Report:
    """Errors of both models, the effect of temperature, figure 10's signs and leakage; on an emulated finger."""
    result = result or measure(options)
    validation, both, truth = result.validation, result.both, result.validation.run.truth
    axes, predicted = validation.run.axes, validation.predicted[0]
    errors = {PAPER: rmse(result.paper[both], truth[both]), CALIBRATED: rmse(predicted[both], truth[both])}
    share, spread = errors[CALIBRATED] / errors[PAPER], truth[both].std(axis=0)
    head = ["", *[f"{axis} [{'N' if axis.startswith('F') else 'N mm'}]" for axis in axes]]

    def table(title: str, rows: dict[str, Floats], text: str) -> Table:
        return Table(title, head, [[name, *values.tolist()] for name, values in rows.items()], text, digits=2)

    tables = [
        table("Shear and torsion at once", errors | {"calibrated / paper": share, "spread of the truth": spread},
              f"RMSE held out, over the {both.sum()} frames with both."),
        table("Each model", {name: found[0] for name, found in validation.by_model.items()},
              f"RMSE held out, over all {len(truth)} frames; chosen: {validation.wrench_map.model}."),
        table("Temperature", result.warm,
              f"Up to {WARM_C:g} C away from the calibration temperature, over frames with both."),
        torsion_shear.convolved(result.replayed),
    ]  # fmt: skip
    checks = [
        check("Fy under shear and torsion, RMSE relative to the paper's", share[FY], FY_LIMIT, "times"),
        check("torsion under both, RMSE relative to the paper's", share[TORSION], TORSION_LIMIT, "times"),
        check("the same, relative to predicting no torsion", errors[CALIBRATED][TORSION] / spread[TORSION],
              TORSION_LIMIT, "times"),
        *torsion_shear.checks(result.replayed),
    ]  # fmt: skip
    notes = [
        f"{len(truth)} frames of one contact each, with noise; {validation.blocks.contacts} locations, a twentieth "
        "held out at a time",
        f"{PAPER}: Eq 3 and 4, six scales, the same frames held out, torsion = (M - c x F) . n at the c of Eq 1",
        f"{CALIBRATED}: what `biotac calibrate wrench` chose; torsion is an axis of its own",
        f"figure 10's trial was not trained on: {result.replayed.notes[0]}",
    ]
    return Report(options.source, tables, checks, notes, lambda figure: _draw(figure, result, options.source))


def _paper(validation: Validation) -> Floats:
    """Eq 1 to 4 (n, 7): six scales by least squares without offset; torsion about the paper's own point of contact."""
    run = validation.run
    e = run.counts - run.tare
    arms = np.cross(surface.ELECTRODE_MM, surface.ELECTRODE_NORMAL)
    sums = e @ np.hstack([surface.ELECTRODE_NORMAL, arms])
    result = np.empty_like(run.truth)
    for block in range(len(validation.folds)):
        rows = validation.blocks.rows(block)
        trained = np.setdiff1d(np.arange(len(e)), rows)
        x, y = sums[trained], run.truth[trained, :6]
        result[rows, :6] = sums[rows] * ((x * y).sum(axis=0) / (x * x).sum(axis=0))
    squared = e**2
    point = surface.project(squared @ surface.ELECTRODE_MM / squared.sum(axis=1, keepdims=True))
    result[:, TORSION] = torsion(result[:, :3], result[:, 3:6], point)
    return result


def _warm(finger: SimFinger, loads: States, both: Bools, validation: Validation, seed: int) -> dict[str, Floats]:
    """RMSE (7,), held out, at up to WARM_C off the calibration temperature, for each way the tare may follow it."""
    celsius = np.random.default_rng([seed, 33]).uniform(-WARM_C, WARM_C, len(loads))
    cold = validation.run.counts
    # the same noise as before, plus the effect of temperature
    counts = cold + finger.counts(replace(loads, warm_c=celsius)) - finger.counts(loads)
    tdc = tdc_counts(REST_CELSIUS + celsius) - float(tdc_counts(np.array([REST_CELSIUS]))[0])
    gained = finger.rest_counts(celsius) - finger.rest_counts(np.zeros(1))
    own = float((gained.mean(axis=1) @ tdc) / (tdc @ tdc))
    default = messages.SETTINGS[Setting.THERMAL_GAIN_MILLI].default / 1000.0
    tare = validation.run.tare
    ways = {
        "at 30 C": (cold, np.broadcast_to(tare, cold.shape)),
        "tare stays": (counts, np.broadcast_to(tare, cold.shape)),
        f"tare follows TDC, the default {default:g} counts each": (counts, tare + default * tdc[:, None]),
        f"tare follows TDC, this finger's {own:.2f} counts each": (counts, tare + own * tdc[:, None]),
        "tared at that temperature": (counts, tare + gained),
    }
    return {name: rmse(_held_out(validation, *way)[both], validation.run.truth[both]) for name, way in ways.items()}


def _held_out(validation: Validation, counts: Floats, tare: Floats) -> Floats:
    """Prediction (n, 7) of each row's own fold for other ``counts`` (n, 19) and ``tare`` (n, 19), frame by frame."""
    run = validation.run
    result = np.empty_like(run.truth)
    for block, fit in enumerate(validation.folds):
        rows = validation.blocks.rows(block)
        fitted = WrenchMap("held out", run.axes, tare[rows], 1, (0,) * len(run.axes), fit.best)
        result[rows] = fitted.predict(counts[rows], None if run.pdc is None else run.pdc[rows])
    return result


def _draw(figure: Any, result: Result, source: str) -> None:
    """Fy and torsion against the truth, for the paper's model and the map."""
    run, both = result.validation.run, result.both
    figure.set_size_inches(11, 5)
    figure.suptitle(f"Shear and torsion at once, held-out locations: {source}")
    for panel, axis, unit in zip(figure.subplots(1, 2), (FY, TORSION), ("N", "N mm"), strict=True):
        true = run.truth[both, axis]
        for guess, label, color in (
            (result.paper, f"{PAPER} (Eq 3 and 4)", "#9ca3af"),
            (result.validation.predicted[0], CALIBRATED, "#15803d"),
        ):
            panel.plot(true, guess[both, axis], ".", color=color, markersize=2, alpha=0.6, label=label)
        ends = [float(true.min()), float(true.max())]
        panel.plot(ends, ends, color="#111111", linewidth=1)
        panel.set(xlabel=f"true {run.axes[axis]} [{unit}]", ylabel=f"estimated [{unit}]")
        panel.set_ylim(2.0 * ends[0], 2.0 * ends[1])
        panel.grid(alpha=0.3)
        panel.legend(markerscale=5)
