"""The front that matters: cycles of a force on the board against its error on real fingers, in newtons.

Every error is of what was not seen: a finger's own map is judged block by block as `biotac calibrate wrench` does, and
a map of other fingers on a finger that it was not made of. Cycles are those that `tools/bench/run --keep` counted on
emulated cores.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ...calibrate.population import keeping, training, worth
from ...calibrate.population.training import Population
from ...calibrate.wrench import figures, fitted, models
from ...calibrate.wrench.crossvalidation import Validation, validate
from ...calibrate.wrench.run import Run
from ...calibrate.wrench.sources import load
from ...core.compute import compute
from ...core.geometry import Floats
from ...errors import InputError
from ...wire import messages_gen as wire

CYCLES = "cycles.json"
LIN = {wire.Setting.FORCE_MODEL: wire.ForceModel.LIN}
OWN = "its own force plate"
#: A finger's own models, what the board runs for each, and what they are called.
OWN_MODELS = (
    (models.LIN, "Lin's scales", "Lin's scales"),
    (models.LIN_OFFSET, "signals and offset, 3 axes", "Lin's scales and offsets"),
    (models.AFFINE.name, "signals and offset, 3 axes", "affine"),
    (models.CONDUCTANCE.name, "quadratic in conductance, 3 axes", "small map"),
    (models.JOINED.name, "population and a scale, 3 axes", "joined map"),  # of the same blocks
    (models.POOLED, "pooled, 3 axes", "large map"),
)
NEAREST = 0.05  # of the rows, those whose counts came back closest, stand for "the same pattern"
EVERY_ROW = 4  # looked at for that
GUARD_ROWS = 1000

Show = Callable[[str], None]


@dataclass(frozen=True)
class Point:
    """A way to a force: ``knows`` of the finger; ``cycles`` by core; ``rmse_n`` by recording, x y z."""

    name: str
    knows: str
    cycles: dict[str, int]
    rmse_n: dict[str, list[float]]

    @property
    def error_n(self) -> float:
        """RMS length of the force's error, the geometric mean over the recordings."""
        return float(np.exp(np.mean([np.log(np.linalg.norm(rmse)) for rmse in self.rmse_n.values()])))


@dataclass(frozen=True)
class Outcome:
    """``noise_n``: what the electrodes' noise is through the large map, in a frame; ``repeatability_n``: how far the
    plate differs from itself, less what the large map tells, when the counts come back. Both by recording, x y z.
    ``cores``: title and where cycles are from.
    """

    points: list[Point]
    noise_n: dict[str, list[float]]
    repeatability_n: dict[str, list[float]]
    cores: dict[str, dict[str, str]]
    notes: list[str]


def measure(files: Sequence[Path], show: Show = lambda text: None) -> Outcome:
    """All points on recordings as for `biotac calibrate wrench`. Raises InputError and RecordingError."""
    if not files:
        raise InputError("no recording was named: expected one or more with force beside counts, such as F1.npz")
    names = [path.name for path in files]
    if len(set(names)) < len(names):
        raise InputError(f"{', '.join(names)}: two have one name; rename one")
    kept = json.loads(resources.files(__package__).joinpath(CYCLES).read_text(encoding="utf-8"))
    runs = {path.name: load(path).run for path in files}
    with threadpool_limits(limits=1, user_api="blas"):
        others, notes = _of_others(files, list(runs.values()))
    found: dict[str, dict[str, list[float]]] = {}
    noise, repeats = {}, {}
    for name, run in runs.items():
        show(f"{name}: what others know of it")
        if name in others:
            for key, rmse in _untrained(others[name], run).items():
                found.setdefault(key, {})[name] = rmse
        by_lin = compute(run.counts.astype(np.uint16), run.tare, LIN)["force_n"]
        found.setdefault(LINS, {})[name] = _rmse(by_lin, run.truth[:, :3])
        its = validate(run, show=show)
        for model, _, _ in OWN_MODELS:
            found.setdefault(model, {})[name] = its.by_model[model][0][:3].tolist()
        noise[name], repeats[name] = _noise(its), _repeatability(its)
    listed = [*UNTRAINED, *((model, OWN, called, scene) for model, scene, called in OWN_MODELS)]
    points = [
        Point(called, knows, {core: its["cycles"][scene] for core, its in kept.items()}, found[key])
        for key, knows, called, scene in listed
        if key in found
    ]
    cores = {core: {what: its[what] for what in ("title", "cycles_by")} for core, its in kept.items()}
    return Outcome(points, noise, repeats, cores, notes)


LINS, POPULATION, PRESSES, MINUTE = "default", "population", "presses", "minute"
UNTRAINED = (
    (LINS, "nothing", "Lin's scales, the firmware's", "Lin's scales"),
    (POPULATION, "nothing", "population map", "population"),
    (PRESSES, "five presses on a scale", "population map, scaled", "population and a scale, 3 axes"),
    (MINUTE, "a minute of force plate", "population map, pulled", "population and a scale, 3 axes"),
)


def _of_others(files: Sequence[Path], runs: list[Run]) -> tuple[dict[str, Population], list[str]]:
    """By recording the map of the others; of a single one the package's, if it was not made of it."""
    if len(runs) > 1:
        fingers = [training.sums_of(training.aligned(run)) for run in runs]
        return {
            path.name: training.train([its for j, its in enumerate(fingers) if j != k], symmetric=True)
            for k, path in enumerate(files)
        }, ["population maps are of the other recordings, symmetric as the package's"]
    kept = keeping.load(None)
    path = files[0]
    if keeping.made_of(kept, [path]):
        return {}, [f"the package's population map was made of {path.name}: name another finger's recording too"]
    return {path.name: kept.its}, ["the population map is the package's"]


def _untrained(its: Population, run: Run) -> dict[str, list[float]]:
    found = worth.worth(its, training.aligned(run))
    all_three = {POPULATION: found.rmse_n, PRESSES: found.rmse_scale5_n, MINUTE: found.rmse_60s_n}
    return {key: rmse.tolist() for key, rmse in all_three.items() if rmse is not None}


def _noise(its: Validation) -> list[float]:
    """Electrode noise, from second differences, which slow loads leave, through the map of the whole run."""
    run, rng = its.run, np.random.default_rng(0)
    curve = np.diff(run.counts, n=2, axis=0)
    sigma = np.median(np.abs(curve), axis=0) / 0.6745 / np.sqrt(6.0)
    rows = rng.integers(0, len(run.counts), 2000)
    pdc = None if run.pdc is None else run.pdc[rows]
    map_of_all = fitted.of(its)
    counts = run.counts[rows]
    noisy = counts + rng.normal(size=counts.shape) * sigma
    there, here = (map_of_all.predict(its, pdc)[:, :3] for its in (noisy, counts))
    return _rmse(there, here)


def _repeatability(its: Validation) -> list[float]:
    """Held-out errors of rows whose counts are nearest each other and seconds apart: what differs is no map's fault."""
    run = its.run
    error = its.predicted[0][:, :3] - run.truth[:, :3]
    rows = np.arange(0, len(run.counts), EVERY_ROW)
    near, distance = _nearest(run.counts - run.tare, rows)
    same = distance <= np.quantile(distance, NEAREST)
    return [value / float(np.sqrt(2.0)) for value in _rmse(error[rows[same]], error[near[same]])]


def _nearest(e: Floats, rows: NDArray[np.intp]) -> tuple[NDArray[np.intp], Floats]:
    """Of each of ``rows`` the row nearest in counts that is GUARD_ROWS or more away, and how near."""
    size, every = (e**2).sum(axis=1), np.arange(len(e))
    near, distance = np.zeros(len(rows), np.intp), np.zeros(len(rows))
    for start in range(0, len(rows), 500):
        some = rows[start : start + 500]
        squares = size[some][:, None] + size - 2.0 * e[some] @ e.T
        squares[np.abs(some[:, None] - every) < GUARD_ROWS] = np.inf
        near[start : start + 500], distance[start : start + 500] = squares.argmin(axis=1), squares.min(axis=1)
    return near, distance


def _rmse(one: Floats, other: Floats) -> list[float]:
    return [float(value) for value in figures.rmse(one, other)]


def facts(its: Outcome) -> dict[str, Any]:
    """As JSON types."""
    points = [
        {"name": p.name, "knows": p.knows, "cycles": p.cycles, "rmse_n": p.rmse_n, "error_n": p.error_n}
        for p in its.points
    ]
    return {
        "points": points,
        "noise_n": its.noise_n,
        "repeatability_n": its.repeatability_n,
        "cores": its.cores,
        "notes": its.notes,
    }
