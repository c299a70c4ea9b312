"""Shear and torsion at once: how well a calibrated map and the paper's formulas estimate them.

Lin, Fishel and Loeb 2013 call the two "substantially convolved" (figure 10). Here an emulated finger is pressed,
sheared and twisted at random over its pad, and calibrated with the code of ``biotac calibrate wrench``, with contact
locations held out. Then it is warmed and cooled, and put through figure 10's trial, which was not in training.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...calibrate.wrench import figures, report
from ...calibrate.wrench.crossvalidation import Validation, validate
from ...calibrate.wrench.models import lin_directions
from ...calibrate.wrench.run import load_run
from ...calibrate.wrench.splits import BLOCKS
from ...core import geometry as surface
from ...core.geometry import Floats
from ...map.columns import AXES, Signals, columns, with_one
from ...map.file import dumps_fitted
from ...markdown import table
from ...sim import sampling
from ...sim.physics import REST_CELSIUS, Finger, States
from ...wire.messages_gen import SETTINGS, Setting
from . import random_loads, torsion_shear, weight
from .estimates import torsion
from .outcome import Facts, Options, check, numbers, text
from .trial import Bools

RECORDING = ""
MAPS = False

FRAMES = 9000
FY, TORSION = 1, 6
PAPER, CALIBRATED = "paper", "calibrated"
FY_LIMIT, TORSION_LIMIT = 0.4, 0.6  # of the paper's RMSE, from issue 6
WARM_C = 8.0  # numerics.md 3.3


@dataclass(frozen=True)
class Result:
    """A calibration and its trials.

    ``validation`` is of the random loads; ``both`` (n,) marks those with shear and torsion at once. ``paper`` (n, 7) is
    Lin's Eq 3 and 4 on them, its six scales fitted without the row's own block. ``warm`` maps each way to handle
    temperature to its RMSE (7,) over ``both``. ``replayed`` is figure 10's trial by the paper's model and by the map.
    """

    seed: int
    validation: Validation
    both: Bools
    paper: Floats
    warm: dict[str, Floats]
    replayed: weight.Result


def run(options: Options) -> Result:
    """Run on the emulated finger of the options' seed."""
    finger = Finger(options.seed)
    loads, cell = random_loads.states(FRAMES, options.seed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"emulated-{options.seed}.npz"
        np.savez(path, **random_loads.recording(finger, loads, cell, options.seed))
        validation = validate(load_run(path), show=options.show)
        its = Path(folder) / f"{CALIBRATED}.wrench.json"
        its.write_text(dumps_fitted(validation.wrench_map), encoding="utf-8")
        replayed = torsion_shear.run(replace(options, maps=(its,)))
    both = np.asarray((np.linalg.norm(loads.shear_n, axis=1) > 0.0) & (loads.torsion_nmm != 0.0))
    warm = _warm(finger, loads, both, validation, options.seed)
    return Result(options.seed, validation, both, _paper(validation), warm, replayed)


def _paper(validation: Validation) -> Floats:
    """Eq 1 to 4 (n, 7): six scales by least squares without offset; torsion about the paper's own point of contact."""
    run, blocks = validation.run, validation.blocks
    e = run.counts - run.tare
    sums = e @ lin_directions(6)
    result = np.empty_like(run.truth)
    for block in range(BLOCKS):
        rows = blocks.rows(block)
        trained = np.setdiff1d(np.arange(len(e)), rows)
        x, y = sums[trained], run.truth[trained, :6]
        result[rows, :6] = sums[rows] * ((x * y).sum(axis=0) / (x * x).sum(axis=0))
    squared = e**2
    point = surface.project(squared @ surface.ELECTRODE_MM / squared.sum(axis=1, keepdims=True))
    result[:, TORSION] = torsion(result[:, :3], result[:, 3:6], point)
    return result


def _warm(finger: Finger, loads: States, both: Bools, validation: Validation, seed: int) -> dict[str, Floats]:
    """RMSE (7,), held out, at up to WARM_C off the calibration temperature, for each way the tare may follow it."""
    celsius = np.random.default_rng([seed, 33]).uniform(-WARM_C, WARM_C, len(loads))
    cold = validation.run.counts
    # the same noise as before, plus the effect of temperature
    counts = cold + finger.counts(replace(loads, warm_c=celsius)) - finger.counts(loads)
    tdc = sampling.tdc_counts(REST_CELSIUS + celsius) - float(sampling.tdc_counts(np.array([REST_CELSIUS]))[0])
    gained = finger.rest_counts(celsius) - finger.rest_counts(np.zeros(1))
    own = float((gained.mean(axis=1) @ tdc) / (tdc @ tdc))
    default = SETTINGS[Setting.THERMAL_GAIN_MILLI].default / 1000.0
    tare = validation.run.tare
    ways = {
        "at 30 C": (cold, np.broadcast_to(tare, cold.shape)),
        "tare stays": (counts, np.broadcast_to(tare, cold.shape)),
        f"tare follows TDC, the default {default:g} counts each": (counts, tare + default * tdc[:, None]),
        f"tare follows TDC, this finger's {own:.2f} counts each": (counts, tare + own * tdc[:, None]),
        "tared at that temperature": (counts, tare + gained),
    }
    return {
        name: figures.rmse(_held_out(validation, c, t)[both], validation.run.truth[both])
        for name, (c, t) in ways.items()
    }


def _held_out(validation: Validation, counts: Floats, tare: Floats) -> Floats:
    """Prediction (n, 7) of each row's own fold for other ``counts`` (n, 19) and ``tare`` (n, 19), frame by frame."""
    result = np.empty_like(validation.run.truth)
    for block, fit in enumerate(validation.folds):
        rows = validation.blocks.rows(block)
        pdc = validation.run.pdc
        signals = Signals(counts[rows] - tare[rows], tare[rows], None if pdc is None else pdc[rows])
        result[rows] = with_one(columns(signals)) @ fit.best
    return result


def facts(result: Result) -> Facts:
    """Errors of both models, the effect of temperature, figure 10's signs and leakage."""
    validation, both = result.validation, result.both
    truth = validation.run.truth
    errors = {
        PAPER: figures.rmse(result.paper[both], truth[both]),
        CALIBRATED: figures.rmse(validation.predicted[0][both], truth[both]),
    }
    share = errors[CALIBRATED] / errors[PAPER]
    spread = truth[both].std(axis=0)
    replayed = torsion_shear.facts(result.replayed)
    tried = {name: replayed["models"][name] for name in (PAPER, CALIBRATED)}
    summary = figures.summary(validation)
    return {
        "experiment": "shear-torsion",
        "source": f"emulated finger, seed {result.seed}",
        "frames": len(truth),
        "frames_with_both": int(both.sum()),
        "locations": validation.blocks.contacts,
        "axes": list(AXES),
        "model": summary["model"],
        "rest_n": numbers(summary["rest_n"]),
        "spread": numbers(spread),
        "rmse": {name: numbers(these) for name, these in errors.items()},
        "share_of_paper": numbers(share),
        "by_model": {name: numbers(rmse[0]) for name, rmse in validation.by_model.items()},
        "warm": {name: numbers(these) for name, these in result.warm.items()},
        "replay": {
            name: {key: one[key] for key in ("sign_right", "leak_n_per_nmm")} for name, one in tried.items()
        },
        "checks": [
            check("Fy under shear and torsion, RMSE relative to the paper's", share[FY], FY_LIMIT, "times"),
            check("torsion under both, RMSE relative to the paper's", share[TORSION], TORSION_LIMIT, "times"),
            check("the same, relative to predicting no torsion", errors[CALIBRATED][TORSION] / spread[TORSION],
                  TORSION_LIMIT, "times"),
            *[one for one in replayed["checks"] if one["what"].startswith(CALIBRATED)],
        ],
        "notes": [
            f"{FRAMES} frames of one contact each, with noise; {validation.blocks.contacts} locations "
            f"({random_loads.CELL_MM:g} mm by {random_loads.CELL_DEG:g} deg), a twentieth held out at a time",
            f"{PAPER}: Eq 3 and 4, six scales, the same frames held out, torsion = (M - c x F) . n at the c of Eq 1",
            f"{CALIBRATED}: what `biotac calibrate wrench` chose; torsion is an axis of its own",
            *result.replayed.notes[:1],
        ],
    }  # fmt: skip


def page(facts: Facts) -> list[str]:
    """Errors, models, temperature, figure 10."""
    units = ["N" if axis.startswith("F") else "N mm" for axis in facts["axes"]]
    head = [f"{axis} [{unit}]" for axis, unit in zip(facts["axes"], units, strict=True)]

    def row(name: str, values: list[float | None]) -> list[str]:
        return [name, *[text(value, 2) for value in values]]

    rows = [row(name, values) for name, values in facts["rmse"].items()]
    rows += [row("calibrated / paper", facts["share_of_paper"]), row("spread of the truth", facts["spread"])]
    words = {True: "right", False: "WRONG"}
    replayed = [
        [name, *[words[right] for right in one["sign_right"].values()], text(one["leak_n_per_nmm"])]
        for name, one in facts["replay"].items()
    ]
    return [
        f"RMSE held out, over the {facts['frames_with_both']} frames with shear and torsion at once:",
        "",
        *table(["", *head], rows),
        f"Each model, over all {facts['frames']} frames; chosen: {facts['model']}.",
        "",
        *table(["model", *head], [row(name, values) for name, values in facts["by_model"].items()]),
        f"Up to {WARM_C:g} C away from the calibration temperature, over frames with both:",
        "",
        *table(["", *head], [row(name, values) for name, values in facts["warm"].items()]),
        "Figure 10's trial, not trained on: sign of the torsion in both turns of each region, and how much of region",
        "II's pure torsion appears as Fy.",
        "",
        *table(["model", "sign in I", "in II", "in III", "leak [N per N mm]"], replayed),
        f"With nothing touching, the map gives {text(facts['rest_n'][0])} N.",
        "",
    ]


def draw(result: Result, figure: Any) -> None:
    """Fy and torsion against the truth, for the paper's model and the map."""
    truth, both = result.validation.run.truth, result.both
    figure.set_size_inches(11, 5)
    panels = figure.subplots(1, 2)
    figure.suptitle(f"Shear and torsion at once, held-out locations: emulated finger, seed {result.seed}")
    for panel, axis, unit in zip(panels, (FY, TORSION), ("N", "N mm"), strict=True):
        for guess, label, color in (
            (result.paper, f"{PAPER} (Eq 3 and 4)", "#9ca3af"),
            (result.validation.predicted[0], CALIBRATED, report.AXIS_COLORS[1]),
        ):
            panel.plot(truth[both, axis], guess[both, axis], ".", color=color, markersize=2, alpha=0.6, label=label)
        ends = [float(truth[both, axis].min()), float(truth[both, axis].max())]
        panel.plot(ends, ends, color="#111111", linewidth=1)
        panel.set(xlabel=f"true {AXES[axis]} [{unit}]", ylabel=f"estimated {AXES[axis]} [{unit}]")
        panel.set_ylim(2.0 * ends[0], 2.0 * ends[1])
        panel.grid(alpha=0.3)
        panel.legend(markerscale=5)
