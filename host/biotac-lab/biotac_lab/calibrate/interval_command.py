"""biotac-lab interval REC..."""

from __future__ import annotations

import argparse
from pathlib import Path

from threadpoolctl import threadpool_limits

from biotac import InputError
from biotac.calibrate.wrench import load

from ..report import Outcome, Show, Table, of_tables
from .interval import (
    Finger,
    Judged,
    Settings,
    lin_rows,
    lin_settings,
    own_rows,
    population_margin,
    share_without_electrode,
    together,
)

ABOUT = "How often the 95 % intervals of normal and shear are right, on frames that the force's source had not seen."
EXAMPLE = "biotac-lab interval F1.npz F2.npz"
HEAD = ["source", "part", "band [N]", "frames", "within", "median half width [N]", "over RMS error"]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recordings."""
    parser.add_argument(
        "files", metavar="REC", nargs="+", type=Path, help="one finger per file, as for calibrate wrench; two or more"
    )


def run(args: argparse.Namespace, show: Show) -> Outcome:
    """Judge the three sources on each finger."""
    if len(args.files) < 2:
        raise InputError("one recording: expected at least two fingers, each to be left out of the others' map")
    with threadpool_limits(limits=1, user_api="blas"):
        tables = judge([Finger.of_run(load(path).run) for path in args.files], [path.name for path in args.files], show)
    return of_tables(tables, {"tables": [table.facts() for table in tables]})


def judge(fingers: list[Finger], names: list[str], show: Show) -> list[Table]:
    """The tables: the three sources by band, and with one electrode out."""
    margin, by_population = population_margin(fingers)
    rows, own, out = [], [], []
    for finger, name in zip(fingers, names, strict=True):
        show(f"{name}: its own map")
        others = [other for other in fingers if other is not finger]
        whole, crossed, blob = own_rows(finger)
        own.append(whole)
        rows += _rows(f"own map, {name}", whole) + _rows(f"the same, margin of every other block, {name}", crossed)
        show(f"{name}: electrodes out")
        by: tuple[tuple[str, Settings, bytes | None], ...]
        by = (("own map", {}, blob), ("population", {}, None), ("Lin", lin_settings(others), None))
        out += [[source, name, *share_without_electrode(finger, *given)] for source, *given in by]
    lin = [lin_rows(finger, [other for other in fingers if other is not finger]) for finger in fingers]
    for source, each in (("own map", own), ("population", by_population), ("Lin", lin)):
        rows += _rows(source, together(each))
    text = f"The population map's margin: base {list(margin.base_mn)} mN, share {list(margin.share_q8)} / 256."
    title = "With one electrode out: the healthy finger's force is within"
    return [
        Table("Left-out frames within the interval", HEAD, rows, text),
        Table(title, ["source", "finger", "normal", "shear"], out),
    ]


def _rows(source: str, judged: Judged) -> list[list[object]]:
    return [[source, *line] for line in judged.touched().lines()]
