"""biotac-lab direction FILE..."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import biotac
from biotac import Finger, ForceModel, FrameFlags, QuantityFlags, RecordingError, Setting
from biotac.calibrate import population, wrench
from biotac.core import to_frames

from ..experiments import laboratory, plate_normal
from ..report import Outcome, Show, Table, of_tables
from . import training
from .peer_net import PeerNet

ABOUT = "Where the default force points, against a plate's normal, a measured force, or fingers that can only press."
EXAMPLE = "biotac-lab direction trial.npz pinch.npz F1.npz --peer tf_models/icra19/momentum/checkpoints"
REST = 2900  # the default force knows counts above the tare alone
DATA = "model.ckpt.data-00000-of-00001"
SIDE, WRONG_DEG, FIRM_N, LIGHT_N = 0.3, 45.0, 0.5, (0.3, 2.0)
LIGHT = f"{LIGHT_N[0]:g} to {LIGHT_N[1]:g} N"
HEAD = ["recording", "by", "frames", "median deg", "p90", "y sign right", "y corr.", "x sign right", "pulls", "wrong",
        "wrong flagged", "others flagged", "RMSE N"]  # fmt: skip


@dataclass(frozen=True)
class Case:
    """Counts above the tare ``e`` (n, 19), and ``truth`` (n, 3): force in N, a direction, or NaN; on the finger."""

    name: str
    e: Any
    truth: Any
    in_n: bool = False


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recordings and other nets."""
    kinds = "an .npz with E, PDC and z_dir (a plate), E and F (as calibrate wrench takes it), or L and R (e in a pinch)"
    parser.add_argument("files", metavar="FILE", nargs="+", type=Path, help=kinds)
    peer = f"also a trained net of balakumar-s/biotac_force_net, the folder of its {DATA}; may be repeated"
    parser.add_argument("--peer", metavar="FOLDER", type=Path, action="append", default=[], help=peer)


def run(args: argparse.Namespace, show: Show) -> Outcome:
    """A row for each recording and estimate."""
    nets = {str(path): PeerNet(path / DATA) for path in args.peer}
    rows = []
    for path in args.files:
        for case in _cases(path):
            show(case.name)
            frames = _board(case.e)
            outside = (frames["flags"] & FrameFlags.OUTSIDE) != 0
            lin = biotac.compute(_counts(case.e), np.full(19, float(REST)), {Setting.FORCE_MODEL: ForceModel.LIN})[
                "force_n"
            ]
            rows += [[case.name, "default", *_judged(case, frames["force_n"], outside)]]
            rows += [[case.name, "Lin's scales", *_judged(case, lin)]]
            rows += [[case.name, name, *_judged(case, net.force_n(case.e))] for name, net in nets.items()]
    text = (
        f"Sides: components beyond {SIDE:g}. Pulls: force out of the finger, without OUTSIDE. Wrong: off by more than "
        f"{WRONG_DEG:g} deg above {FIRM_N:g} N. The default was trained on what its map's provenance names."
    )
    table = Table("Direction of force", HEAD, rows, text, digits=3)
    return of_tables([table], table.facts())


def _cases(path: Path) -> Iterator[Case]:
    with np.load(path) as archive:
        fields = {name: archive[name] for name in set(archive.files) & {"z_dir", "F", "L", "R"}}
    if "z_dir" in fields:
        trial = laboratory.load(path, needs=("PDC", "z_dir"))
        rows = trial.touched & (trial.pressure > plate_normal.CONTACT_COUNTS) & np.isfinite(trial.signal).all(axis=1)
        yield Case(path.name, trial.signal[rows], -trial.plate_normal[rows])
    elif "F" in fields:
        aligned = training.aligned(wrench.load(path).run)
        e, light = aligned.counts - aligned.tare, is_light(aligned.truth)
        yield Case(path.name, e, aligned.truth, in_n=True)
        yield Case(f"{path.name}, {LIGHT}", e[light], aligned.truth[light], in_n=True)
    elif "L" in fields and "R" in fields:
        for name in "LR":
            yield Case(f"{path.name}, {name}", fields[name], np.full((len(fields[name]), 3), np.nan))
    else:
        raise RecordingError(f"{path}: expected E with z_dir or F, or L and R")


def is_light(force_n: Any) -> Any:
    """Which of n forces (n, 3) are light."""
    size_n = np.linalg.norm(force_n, axis=1)
    return (size_n > LIGHT_N[0]) & (size_n < LIGHT_N[1])


def of_population(name: str, prior: population.Population, run: wrench.Run) -> Table:
    """The direction of a map that was trained on other fingers."""
    force_n, outside = prior.published(run.counts, run.tare), prior.judged(run.counts, run.tare).outside
    light = is_light(run.truth)
    every = [(name, slice(None))] + ([(f"{name}, {LIGHT}", light)] if light.any() else [])
    rows = [
        [part, "published", *_judged(Case(part, None, run.truth[at], in_n=True), force_n[at], outside[at])]
        for part, at in every
    ]
    return Table("Direction of force", HEAD, rows)


def _counts(e: Any) -> Any:
    return np.clip(np.rint(REST + e), 0, 4095).astype(np.uint16)


def _board(e: Any) -> Any:
    finger = Finger({}, quantities=QuantityFlags.FORCE)
    finger.feed(np.full((50, 19), REST))
    finger.set_tare(np.full(19, float(REST)))
    finger.hold()
    return to_frames(finger.feed(_counts(e)))


def _judged(case: Case, force_n: Any, outside: Any | None = None) -> list[Any]:
    flagged = np.zeros(len(force_n), bool) if outside is None else outside
    pulls = float(((force_n[:, 2] < 0.0) & ~flagged).mean())
    if np.isnan(case.truth).all():
        return [len(force_n), *[None] * 5, pulls, *[None] * 4]
    size_n = np.linalg.norm(force_n, axis=1, keepdims=True)
    unit, into = (v / np.maximum(np.linalg.norm(v, axis=1, keepdims=True), 1e-9) for v in (force_n, case.truth))
    off = wrench.angles_deg(unit, into)
    wrong = (off > WRONG_DEG) & (~np.array(case.in_n) | (np.linalg.norm(case.truth, axis=1) > FIRM_N))
    right = [_share((force_n * into)[np.abs(into[:, axis]) > SIDE, axis] > 0.0) for axis in (1, 0)]
    flags = [None if outside is None else _share(flagged[rows]) for rows in (wrong, ~wrong)]
    error_n = force_n - (case.truth if case.in_n else into * size_n)
    rmse = float(np.sqrt((error_n**2).sum(axis=1).mean())) if case.in_n else None
    corr = float(np.corrcoef(unit[:, 1], into[:, 1])[0, 1])
    return [len(off), *np.percentile(off, (50, 90)).tolist(), right[0], corr, right[1], pulls, int(wrong.sum()), *flags,
            rmse]  # fmt: skip


def _share(mask: Any) -> float | None:
    return float(mask.mean()) if mask.size else None
