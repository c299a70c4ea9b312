"""biotac-lab finger F1 F2 --plates TRIAL"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from biotac.calibrate.population import Population
from biotac.calibrate.population import load as load_population
from biotac.calibrate.press import scale_of
from biotac.calibrate.wrench import Run, load, rmse, run_of, validate
from biotac.core import geometry as surface
from biotac.sim import SimFinger, States, plate_recording

from ..report import Outcome, Show, Table, check_file, of_tables
from . import off_pad, training
from .finger_fit import Fit, completed, dumps
from .plates import Floats, KnownForce, halves, load_normals, plate_states

ABOUT = "The simulated finger: its numbers fitted to real fingers, and how it compares with them."
EXAMPLE = "biotac-lab finger F1.npz F2.npz --plates trial_15330.npz --check"
FINGERS = 20
UNSEEN_N = np.array([0.54, 0.37, 0.44])  # F2 by the map of F1, before light touches had a gain
LEAST_SHARE, MOST_SHARE, MOST_OUTSIDE = 0.5, 1.2, 0.1
PROBE_MM, PROBE_N = 1.0, 2.0
PRESSES, PRESS_N = 5, (2.0, 6.0)
BANDS_N, MOST_BIAS_N, MOST_BIAS_SHARE = (0.5, 1.0, 2.0, 5.0, 10.0), 0.15, 0.08
CALIBRATED, LOADS, CELL = 2, 4000, (1.5, 0.17)  # fingers, loads of each, and a place's cell in mm and rad
HEAD = ["", "x", "y", "z", "outside"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the two recordings and where the numbers go."""
    parser.add_argument("files", metavar="REC", nargs=2, type=Path, help="a finger on a plate, as for calibrate wrench")
    known = "fingers under a plate of known normal: E, PDC and z_dir; every second press is fitted to, the others judge"
    parser.add_argument("--plates", metavar="TRIAL", nargs="+", type=Path, default=[], help=known)
    parser.add_argument("--out", metavar="FILE", type=Path, help="the numbers go here (skin.json)")
    parser.add_argument("--source", metavar="TEXT", default="not stated", help="origin and licence, stored in the file")
    parser.add_argument("--force", action="store_true", help="overwrite the file")
    parser.add_argument("--seed", metavar="N", type=int, default=0, help="of the first simulated finger (0)")
    limits = f"exit with 1 unless the default map's error is {LEAST_SHARE:g} to {MOST_SHARE:g} times a real finger's"
    parser.add_argument("--check", action="store_true", help=limits)


@dataclass(frozen=True)
class Touched:
    """A simulated finger under loads: ``counts`` (n, 19), ``tare`` (19,), ``truth`` (n, 3) in N."""

    counts: Floats
    tare: Floats
    truth: Floats

    @classmethod
    def by(cls, seed: int, states: Sequence[States], truth: Floats | None = None) -> Touched:
        """Finger ``seed`` under ``states``, with noise; ``truth`` as recorded, if not in the finger's axes."""
        finger, rng = SimFinger(seed), np.random.default_rng([seed, 41])
        counts = np.concatenate([finger.counts(part) for part in states])
        noisy = np.clip(np.rint(counts + rng.normal(0.0, finger.noise_counts, counts.shape)), 0.0, 4095.0)
        if truth is None:
            truth = np.concatenate([part.wrench()[0] for part in states])
        return cls(noisy, finger.rest_counts(np.zeros(1))[0], truth)

    def run(self, like: Run) -> Run:
        """As a recording, with the drift of ``like``."""
        nothing = np.zeros(len(self.counts), np.bool_)
        return replace(
            like, counts=self.counts, tare=self.tare, truth=self.truth, rest=nothing, contact=None, pdc=None, air=None
        )


def run(args: argparse.Namespace, show: Show) -> Outcome:
    """Fit, write, compare."""
    check_file(args.out, overwrite=args.force)
    with threadpool_limits(limits=2, user_api="blas"):
        show("fitting")
        runs = [training.aligned(load(path).run) for path in args.files]
        pressed = [half for recording in runs for half in halves(recording)]
        known = [load_normals(path) for path in args.plates]
        fit = Fit(pressed, [plate.of(plate.fitted) for plate in known])
        skin = completed(fit, runs)
        if args.out is not None:
            args.out.write_text(dumps(skin, args.source), encoding="utf-8")
        names = [f"{path.stem}, {which} half" for path in args.files for which in ("first", "second")]
        names += [f"{path.stem}, every second press" for path in args.plates]
        rows: list[list[Any]] = [
            list(row) for row in zip(names, fit.rms_counts, fit.explained, fit.stale_counts, strict=True)
        ]
        tables = [Table("Fit", ["recording", "RMS counts left", "share explained", "tare is stale by [count]"], rows)]
        plate = [half.states(row) for half, row in zip(pressed, fit.rows, strict=False)]
        seeds, truth = range(args.seed, args.seed + FINGERS), np.concatenate([half.force_n for half in pressed])
        touched = [Touched.by(seed, plate, truth) for seed in seeds]
        default, passed = _default(touched, seeds)
        stems = [path.stem for path in args.files]
        back = _back(touched, runs, stems)
        own, exact = _calibrated(pressed, fit.rows, list(seeds)[:CALIBRATED])
        tables += [default, own, back, _alike(pressed, touched, runs, stems)]
        tables += [off_pad.by_place(pressed, touched, stems)]
        fingers = [SimFinger(seed) for seed in seeds]
        for path, normals in zip(args.plates, known, strict=True):
            tables += off_pad.tables(path.stem, normals, fingers)
    return of_tables(tables, [table.facts() for table in tables], met=passed and exact)


def _judged(population: Population, touched: Sequence[Touched]) -> tuple[Floats, float]:
    """RMSE (fingers, 3) in N as boards publish the force, and the share flagged OUTSIDE."""
    errors, outside = [], []
    for finger in touched:
        likeness = population.judged(finger.counts, finger.tare)
        errors.append(rmse(likeness.mixed(population.force(finger.counts, finger.tare)), finger.truth))
        outside.append(likeness.outside.mean())
    return np.array(errors), float(np.mean(outside))


def _default(touched: Sequence[Touched], seeds: range) -> tuple[Table, bool]:
    population = load_population(None).population
    errors, outside = _judged(population, touched)
    pooled = np.sqrt((errors**2).mean(axis=0))
    n = len(surface.ELECTRODE_MM)
    at, still = surface.project(surface.ELECTRODE_MM), np.zeros(n)
    pokes = States(at, np.full(n, PROBE_N), np.zeros((n, 3)), still, np.full(n, PROBE_MM), still)
    poked, unlike = _judged(population, [Touched.by(seed, [pokes]) for seed in seeds])
    scaled = np.array([_pressed(population, finger, seed) for finger, seed in zip(touched, seeds, strict=True)])
    rows: list[list[Any]] = [
        [f"{len(seeds)} fingers on a plate, all together", *pooled, outside],
        ["the median finger", *np.median(errors, axis=0), None],
        ["the worst of each axis", *errors.max(axis=0), None],
        [f"all after {PRESSES} straight presses (z gain, balance)", *np.sqrt((scaled**2).mean(axis=0)), None],
        [f"{2 * PROBE_MM:g} mm tip on each electrode, {PROBE_N:g} N", *np.sqrt((poked**2).mean(axis=0)), unlike],
        ["F2 by the map of F1, without the gain of light touches", *UNSEEN_N, None],
        ["ratio of the first to it", *(pooled / UNSEEN_N), None],
    ]
    shares = pooled / UNSEEN_N
    passed = bool((shares >= LEAST_SHARE).all() and (shares <= MOST_SHARE).all() and outside <= MOST_OUTSIDE)
    return Table("The default map on simulated fingers: RMSE [N]", HEAD, rows, digits=2), passed


def _pressed(population: Population, finger: Touched, seed: int) -> Floats:
    """RMSE (3,) in N of the map alone after five straight presses where the plate touched."""
    felt = population.force(finger.counts, finger.tare)
    straight = np.hypot(finger.truth[:, 0], finger.truth[:, 1]) < 0.08 * finger.truth[:, 2]
    good = np.flatnonzero(straight & (finger.truth[:, 2] > PRESS_N[0]) & (finger.truth[:, 2] < PRESS_N[1]))
    chosen = np.random.default_rng([seed, 42]).choice(good, PRESSES, replace=False)
    pressed = finger.truth[chosen] * [0.0, 0.0, 1.0]  # a scale shows z alone
    return rmse(scale_of(felt[chosen], pressed).applied(felt), finger.truth)


def _calibrated(pressed: Sequence[KnownForce], rows: Sequence[Floats], seeds: Sequence[int]) -> tuple[Table, bool]:
    """`biotac calibrate wrench` on simulated fingers, pressed where and as the real ones were: the held-out bias."""
    rng = np.random.default_rng(43)
    places = np.concatenate(rows[: len(pressed)])
    drawn = rng.integers(0, len(places), LOADS)
    place, force_n = places[drawn], np.concatenate([half.force_n for half in pressed])[drawn]
    size_n = BANDS_N[0] * (BANDS_N[-1] / BANDS_N[0]) ** rng.random(LOADS)
    force_n *= (size_n / np.linalg.norm(force_n, axis=1))[:, None]
    states = plate_states(place, force_n)
    x, roll = np.floor(place / CELL).T
    table: list[list[Any]] = []
    passed = True
    for seed in seeds:
        arrays = plate_recording(SimFinger(seed), states, (100 * x + roll).astype(np.int64), seed)
        run = run_of(Path("plate"), {name: arrays[name] for name in ("E", "F", "E_base", "E_idle", "contact")})
        held_out = validate(run).predicted[0]
        table.append([f"finger {seed}, RMSE", *rmse(held_out, run.truth), None])
        off = np.linalg.norm(held_out, axis=1) - size_n
        for low, high in pairwise(BANDS_N):
            bias = float(off[(size_n >= low) & (size_n < high)].mean())
            table.append([f"finger {seed}, bias of the strength, {low:g} to {high:g} N", None, None, None, bias])
            passed &= abs(bias) <= max(MOST_BIAS_N, MOST_BIAS_SHARE * low)
    return Table("After `calibrate wrench`, held out [N]", [*HEAD[:4], "strength"], table, digits=3), passed


def _back(touched: Sequence[Touched], runs: Sequence[Run], names: Sequence[str]) -> Table:
    """A map of simulated fingers alone on the real ones, beside the map of the other real finger."""
    simulated = training.train([training.sums_of(finger.run(runs[0])) for finger in touched], symmetric=True)
    real = [training.train([training.sums_of(recording)], symmetric=True) for recording in runs]
    rows: list[list[Any]] = []
    for run, name, other in zip(runs, names, reversed(real), strict=True):
        by_other, by_simulated = (rmse(fit.published(run.counts, run.tare), run.truth) for fit in (other, simulated))
        rows += [[f"{name} by the other", *by_other], [f"{name} by {len(touched)} simulated", *by_simulated]]
        rows += [[f"{name}, ratio", *(by_simulated / by_other)]]
    return Table("The other way round: RMSE [N]", HEAD[:4], rows, digits=2)


def _memory(signal: Floats, size_n: Floats) -> float:
    """Signal per newton while the force falls, over that while it rises, of the half of the rows where it is quick."""
    signal, size_n = (np.convolve(values, np.full(9, 1 / 9), "valid") for values in (signal, size_n))
    rate = np.gradient(size_n)
    quick = np.median(np.abs(rate))
    return float(np.median((signal / size_n)[rate < -quick]) / np.median((signal / size_n)[rate > quick]))


def _alike(parts: Sequence[KnownForce], touched: Sequence[Touched], runs: Sequence[Run], names: Sequence[str]) -> Table:
    """Properties that real and simulated fingers share under the same loads, the real ones' first."""
    real = [np.concatenate([half.counts - half.tare for half in parts[k : k + 2]]) for k in (0, 2)]
    force = [np.concatenate([half.force_n for half in parts[k : k + 2]]) for k in (0, 2)]
    split = len(real[0])
    model = [[(finger.counts - finger.tare)[:split], (finger.counts - finger.tare)[split:]] for finger in touched]
    columns = [*[f"{name}{kind}" for name in names for kind in ("", ", model")]]

    def both(value: Any) -> list[float]:
        return [float(x) for k in (0, 1) for x in (value(real[k], k), np.median([value(e[k], k) for e in model]))]

    def per_n(e: Floats, k: int) -> Any:
        return np.median(np.linalg.norm(e, axis=1) / np.linalg.norm(force[k], axis=1))

    def bulge(e: Floats, k: int) -> Any:
        return np.median((np.maximum(e, 0.0) ** 2).sum(axis=1) / (e**2).sum(axis=1))

    default = load_population(None).population

    def z_slope(e: Floats, k: int) -> Any:
        tare = parts[2 * k].tare
        return np.polyfit(force[k][:, 2], default.published(tare + e, tare)[:, 2], 1)[0]

    upper = np.triu_indices(19, 1)
    corr = [np.corrcoef(e.T)[upper] for e in real]

    def pattern(e: Floats, k: int) -> Any:
        return np.corrcoef(np.corrcoef(e.T)[upper], corr[1 - k])[0, 1]

    def swing(e: Floats, k: int) -> Any:
        return np.corrcoef(e.std(axis=0), real[1 - k].std(axis=0))[0, 1]

    memory: list[float | None] = []  # the model's creep, 2 to 5 % in 10 s, does not show at a hand's pace
    for run in runs:
        signal, size_n = (np.linalg.norm(values, axis=1) for values in (run.counts - run.tare, run.truth))
        memory += [_memory(signal, size_n), None]
    rows: list[list[Any]] = [
        ["signal per newton [count/N], median", *both(per_n)],
        ["share of bulges in the energy, median", *both(bulge)],
        ["slope of the default map's z, trained on both, over the plate's", *both(z_slope)],
        ["correlations of electrodes, alike those of the other real finger", *both(pattern)],
        ["swings of electrodes, alike those of the other real finger", *both(swing)],
        ["hysteresis: signal per newton as force falls, over that as it rises", *memory],
    ]
    return Table("What agrees", ["", *columns], rows, digits=2)
