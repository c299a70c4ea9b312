"""biotac-lab population REC..."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from biotac import InputError
from biotac.calibrate.population import COLUMNS, Trained, dumps, provenance_of
from biotac.calibrate.wrench import Run, load

from ..report import Show, Table
from . import held_out_error, training
from .direction_command import of_population
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


def run(args: argparse.Namespace, show: Show) -> int:
    """Train the map, judge it, write it."""
    if args.test is not None and args.test.resolve() in [path.resolve() for path in args.files]:
        raise InputError(f"{args.test} is both a training file and --test: expected another finger; drop it from one")
    if args.out is not None and args.out.exists() and not args.force:
        raise InputError(f"{args.out} exists; overwrite it (--force) or name another")
    with threadpool_limits(limits=THREADS, user_api="blas"):
        fingers = [Finger.of(load(path).run) for path in args.files]
        tested = None if args.test is None else training.aligned(load(args.test).run)
        facts, trained = _calibrated(args, fingers, tested)
        tables = _tables(facts)
        if tested is not None:
            tables.append(of_population(args.test.name, trained.population, tested))
            facts["direction"] = tables[-1].facts()
    if args.out is not None:
        args.out.write_text(dumps(trained), encoding="utf-8")
        facts["written"] = str(args.out)
    print(json.dumps(facts) if args.json else "\n".join(line for table in tables for line in table.page()))
    return 0


def _calibrated(args: argparse.Namespace, fingers: list[Finger], tested: Run | None) -> tuple[dict[str, Any], Trained]:
    sums, runs = [one.sums for one in fingers], [one.aligned for one in fingers]
    population = training.train(sums, symmetric=args.symmetric)
    if len(fingers) > 1:
        population = replace(population, margin=population_margin(fingers, symmetric=args.symmetric)[0])
    sigma = held_out_error.sigma_of(sums, runs, symmetric=args.symmetric)
    facts: dict[str, Any] = {
        "files": [path.name for path in args.files],
        "symmetric": args.symmetric,
        "columns": COLUMNS,
        "sigma_n": sigma[0].tolist(),
        "sigma_scale5_n": sigma[1].tolist(),
        "margin": [list(population.margin.base_mn), list(population.margin.share_q8)],
    }
    if tested is not None:
        facts["test"] = args.test.name
        facts |= held_out_error.facts(held_out_error.worth(population, tested), sigma)
    source = provenance_of(args.files, args.source, symmetric=args.symmetric)
    return facts, Trained(population, sigma[0], sigma[1], source)


def _tables(facts: dict[str, Any]) -> list[Table]:
    rows = [[f"a new finger of {', '.join(facts['files'])}, one sigma", *facts["sigma_n"]]]
    rows.append(["the same after five presses on a scale", *facts["sigma_scale5_n"]])
    for what, field in (("RMSE", "rmse_n"), ("five presses", "rmse_scale5_n"), ("a minute of plate", "rmse_60s_n")):
        if facts.get(field):
            rows.append([f"{facts['test']}, {what}", *facts[field]])
    within = "".join(f" {share:.0%}" for share in facts.get("coverage", ()))
    text = f"Of the test, within one and two sigma:{within}." if within else ""
    return [Table("Force error [N]", ["", "x", "y", "z"], rows, text)]
