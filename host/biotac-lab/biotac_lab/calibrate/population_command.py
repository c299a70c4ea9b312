"""biotac-lab population REC..."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from biotac import InputError
from biotac.calibrate.population import COLUMNS, Population, Trained, dumps, provenance_of
from biotac.calibrate.wrench import Run, load
from biotac.core import geometry as surface

from ..report import Outcome, Show, Table, check_file, of_tables
from . import held_out_error, off_pad, training
from .direction_command import of_population
from .held_out_error import Worth
from .interval import Finger, population_margin

ABOUT = "A force map for uncalibrated fingers, trained on other fingers on a force plate."
EXAMPLE = "biotac-lab population F1.npz F2.npz --out population.json"
# The fit is a few products of large matrices; threads beyond the free cores only wait for each other.
THREADS = 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the training recordings, the test recording, and where the map goes."""
    parser.add_argument(
        "files", metavar="REC", nargs="+", type=Path, help="one finger per file, as for calibrate wrench"
    )
    parser.add_argument("--test", metavar="REC", type=Path, help="a finger to test the map on; not used for training")
    parser.add_argument(
        "--symmetric", action="store_true", help="F_y too from mirrored fingers: for use on another rig than theirs"
    )
    parser.add_argument("--out", metavar="FILE", type=Path, help="the map goes here (.json)")
    parser.add_argument(
        "--source", metavar="TEXT", default="not stated", help="origin and licence of the data, stored in the map"
    )
    parser.add_argument("--force", action="store_true", help="overwrite existing files")


def run(args: argparse.Namespace, show: Show) -> Outcome:
    """Train the map, test it, write it."""
    if args.test is not None and args.test.resolve() in [path.resolve() for path in args.files]:
        raise InputError(f"{args.test} is both a training file and --test: expected another finger; drop it from one")
    check_file(args.out, overwrite=args.force)
    with threadpool_limits(limits=THREADS, user_api="blas"):
        fingers = [Finger.of_run(load(path).run) for path in args.files]
        tested = None if args.test is None else training.aligned(load(args.test).run)
        sums, runs, judged = [finger.sums for finger in fingers], [finger.aligned for finger in fingers], {}
        population, maps = training.train(sums, symmetric=args.symmetric), []
        if len(fingers) > 1:
            maps = training.of_others(sums, symmetric=args.symmetric)
            population = replace(population, margin=population_margin(fingers, maps)[0])
            left_out = [held_out_error.worth(*each) for each in zip(maps, runs, strict=True)]
            judged = {f"{path.name} by the others": found for path, found in zip(args.files, left_out, strict=True)}
        else:  # the only other finger is the mirror image; presses cannot correct that one's F_x
            left_out = [held_out_error.worth(training.train(sums, mirror=False), training.mirrored(runs[0]))]
        origin = provenance_of(args.files, args.source, symmetric=args.symmetric)
        trained = Trained(population, *held_out_error.sigma_of(left_out), origin)
        facts = _facts(args, trained)
        if tested is not None:
            worth = held_out_error.worth(trained.population, tested)
            judged[f"{args.test.name}, the test"] = worth
            sigma = trained.sigma_n, trained.sigma_scale5_n
            facts |= {"test": args.test.name} | held_out_error.facts(worth, sigma)
        tables = [_errors(facts, judged), _bands(judged)]
        facts["bands"] = tables[-1].facts()
        if maps:
            tables.append(_places([path.name for path in args.files], maps, runs))
            facts["places"] = tables[-1].facts()
        if tested is not None:
            tables.append(of_population(args.test.name, trained.population, tested))
            facts["direction"] = tables[-1].facts()
    if args.out is not None:
        args.out.write_text(dumps(trained), encoding="utf-8")
        facts["written"] = str(args.out)
    return of_tables(tables, facts)


def _facts(args: argparse.Namespace, trained: Trained) -> dict[str, Any]:
    margin = trained.population.margin
    return {
        "files": [path.name for path in args.files],
        "symmetric": args.symmetric,
        "columns": COLUMNS,
        "sigma_n": trained.sigma_n.tolist(),
        "sigma_scale5_n": trained.sigma_scale5_n.tolist(),
        "margin": [list(margin.base_mn), list(margin.share_q8)],
    }


def _errors(facts: dict[str, Any], judged: dict[str, Worth]) -> Table:
    rows = [[f"a new finger of {', '.join(facts['files'])}, one sigma", *facts["sigma_n"]]]
    rows.append(["the same after five presses on a scale", *facts["sigma_scale5_n"]])
    for name, worth in judged.items():
        each = {"RMSE": worth.rmse_n, "five presses": worth.rmse_scale5_n, "a minute of plate": worth.rmse_60s_n}
        rows += [[f"{name}, {way}", *rmse] for way, rmse in each.items() if rmse is not None]
    within = "".join(f" {share:.0%}" for share in facts.get("coverage", ()))
    text = f"Of the test, within one and two sigma:{within}." if within else ""
    return Table("Force error [N]", ["", "x", "y", "z"], rows, text)


def _bands(judged: dict[str, Worth]) -> Table:
    rows = [[name, *band] for name, worth in judged.items() for band in held_out_error.by_band(worth)]
    head = ["finger", "true force [N]", "rows", "bias along it [N]", "bias [%]", "RMS error [N]"]
    return Table("In bands of the true force", head, rows, digits=2)


def _places(names: Sequence[str], maps: Sequence[Population], runs: Sequence[Run]) -> Table:
    rows: list[list[Any]] = []
    for name, other, run in zip(names, maps, runs, strict=True):
        share = np.linalg.norm(other.published(run.counts, run.tare), axis=1) / np.linalg.norm(run.truth, axis=1)
        point = surface.point_of_contact(run.counts - run.tare, 1.0, compressed=True) / surface.RADIUS_MM
        places = off_pad.places_of_points(np.abs(point[:, 1]), np.maximum(point[:, 0], 0.0))
        for place, placed in places.items():
            if placed.sum() >= off_pad.LEAST_ROWS:
                low, median, high = np.percentile(share[placed], (10, 50, 90))
                rows.append([f"{name} by the others", place, int(placed.sum()), median, low, high])
    head = ["finger", "point of contact", "rows", "felt over true", "10 %", "90 %"]
    return Table("Felt over true by place of the point of contact", head, rows, digits=2)
