"""The trade-off that matters: a force's cycles on the board against its error on real fingers in newtons.

Every error is on data held out. A finger's own map is evaluated block by block, as in `biotac calibrate wrench`; a map
of other fingers is evaluated on a finger that was not in training, and so are Lin's default scales. Cycles were counted
by `tools/bench/run --models` on emulated cores (tools/make/figures.py). The time of a frame on this computer, by
biotac.compute, stands in the picture alone: it holds for no other.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib import resources
from pathlib import Path
from time import process_time_ns
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

import biotac
from biotac import InputError, Setting
from biotac.calibrate.population import Population
from biotac.calibrate.population import load as load_population
from biotac.calibrate.wrench import Run, Validation, load, rmse, validate
from biotac.wire import messages

from ..calibrate import held_out_error, training
from ..gains import fit_gains
from ..report import Show, Table
from ..report import picture as drawn
from .batch import LIN, ROUNDS
from .contest import Contestant, timed

Floats = NDArray[np.float64]

CORES = json.loads(resources.files(__package__).joinpath("cycles.json").read_text(encoding="utf-8"))["data"]
OWN = "its own force plate"
#: Model of a finger's own map, the board's kernel for it, and the label.
OWN_MODELS = (
    ("lin-scales", "Lin's scales", "Lin's scales"),
    ("affine", "signals and offset, 3 axes", "affine"),
    ("joined", "joined, 3 axes", "joined map"),
    ("pooled", "pooled, 3 axes", "large map"),
)
#: By the knowledge about the finger.
COLORS = {"nothing": "#c2410c", OWN: "#1d4ed8"}
LITTLE = "#15803d"
FLOORS = (("repeatability_n", "the plate, same pattern again", "--"), ("noise_n", "electrode noise, one frame", ":"))
NEAREST = 0.05  # share of the rows, those with the most similar counts, that stand for "the same pattern"
EVERY_ROW = 4  # one row in this many is looked at for that
GUARD_ROWS = 1000
HOST_FRAMES = 2000
LINS_GAINS = (Setting.FORCE_GAIN_X_NN, Setting.FORCE_GAIN_Y_NN, Setting.FORCE_GAIN_Z_NN)


@dataclass(frozen=True)
class Point:
    """One way to compute force: ``knows`` about the finger; ``cycles`` by core; ``rmse_n`` by recording, for x y z."""

    name: str
    knows: str
    cycles: dict[str, int]
    rmse_n: dict[str, list[float]]
    host_ns: float  # of a frame on this computer

    @property
    def error_n(self) -> float:
        """Error over all recordings and axes."""
        return _pooled(self.rmse_n)


@dataclass(frozen=True)
class Outcome:
    """All points, and two limits of the data, by recording for x y z.

    ``noise_n`` is the effect of one frame's electrode noise through the large map. ``repeatability_n`` is how much the
    plate's force differs when the same counts recur, less the part that the large map explains.
    """

    points: list[Point]
    noise_n: dict[str, list[float]]
    repeatability_n: dict[str, list[float]]
    notes: list[str]


def measure(files: Sequence[Path], picture: Path | None = None, show: Show = lambda text: None) -> list[Table]:
    """Tables of all points, on recordings as for `biotac calibrate wrench`. Raises InputError and RecordingError."""
    outcome = points_of(files, show)
    if picture is not None:
        draw(outcome, picture)
    names = list(outcome.noise_n)
    rows = [
        [p.name, p.knows, *[p.cycles[k] for k in CORES], p.error_n, *[_three(p.rmse_n, k) for k in names]]
        for p in outcome.points
    ]
    floors = [[text, *[_three(getattr(outcome, field), name) for name in names]] for field, text, _ in FLOORS]
    titles = [f"cycles, {about['title']}" for about in CORES.values()]
    text = "; ".join([f"{about['title']}: {about['cycles_by']}" for about in CORES.values()] + outcome.notes)
    return [
        Table("Cycles against newtons", ["", "known about the finger", *titles, "error [N]", *names], rows,
              f"RMSE in x/y/z in N, held out. {text}."),
        Table("Floors", ["", *names], floors),
    ]  # fmt: skip


def _three(rmse_n: dict[str, list[float]], name: str) -> str:
    return "/".join(f"{value:.2f}" for value in rmse_n[name]) if name in rmse_n else "-"


def points_of(files: Sequence[Path], show: Show) -> Outcome:
    """All points and floors."""
    if not files:
        raise InputError("no recording given: name one or more with counts and force, such as F1.npz")
    names = [path.name for path in files]
    if len(set(names)) < len(names):
        raise InputError(f"{', '.join(names)}: two have the same name; rename one")
    runs = {path.name: load(path).run for path in files}
    with threadpool_limits(limits=1, user_api="blas"):
        others, notes = _from_others(files, list(runs.values()))
    found: dict[str, dict[str, list[float]]] = {}
    noise, repeats = {}, {}
    for name, run in runs.items():
        show(f"{name}: maps from other fingers")
        if name in others:
            for key, error in _untrained(others[name], run).items():
                found.setdefault(key, {})[name] = error
        if _made_lins(run):
            notes.append(f"Lin's default scales are {name}'s own, so it does not judge them")
        else:
            by_lin = biotac.compute(run.counts.astype(np.uint16), run.tare, LIN)["force_n"]
            found.setdefault(LINS, {})[name] = rmse(by_lin, run.truth[:, :3]).tolist()
        validation = validate(run, show=show)
        for model, _, _ in OWN_MODELS:
            found.setdefault(model, {})[name] = validation.by_model[model][0][:3].tolist()
        noise[name], repeats[name] = _noise(validation), _repeatability(validation)
    listed = [*UNTRAINED, *((model, OWN, called, scene) for model, scene, called in OWN_MODELS)]
    host = _host_ns(validation)
    points = [
        Point(
            called,
            knows,
            {core: about["cycles"][scene] for core, about in CORES.items()},
            found[key],
            host[key],
        )
        for key, knows, called, scene in listed
        if key in found
    ]
    return Outcome(points, noise, repeats, notes)


LINS, POPULATION, PRESSES, MINUTE = "default", "population", "presses", "minute"
UNTRAINED = (
    (LINS, "nothing", "Lin's scales, an option", "Lin's scales"),
    (POPULATION, "nothing", "population map, the default", "population"),
    (PRESSES, "five presses on a scale", "population map, scaled", "population"),  # boards treat them as that one
    (MINUTE, "a minute of force plate", "population map, pulled", "population"),
)


def _made_lins(run: Run) -> bool:
    """Whether the default force gains are this recording's least squares, up to the rounding of the tare."""
    own = fit_gains(run.counts - run.tare, run.truth[:, :3], np.zeros((len(run.counts), 3)))
    return all(
        abs(own.get(gain.name.lower(), 0) / messages.SETTINGS[gain].default - 1.0) < 0.005 for gain in LINS_GAINS
    )


def _host_ns(validation: Validation) -> dict[str, float]:
    """Time of a frame by biotac.compute for each point."""
    run, fitted = validation.run, validation.wrench_map
    counts, like = run.counts[:HOST_FRAMES].astype(np.uint16), load_population(None).population.wrench_map(run.tare)
    ways: dict[str, dict[str, Any]] = {key: {"settings": LIN} for key in (LINS, OWN_MODELS[0][0])}
    ways |= {POPULATION: {"settings": {}}} | {key: {"wrench_map": like.on_board()} for key in (PRESSES, MINUTE)}
    for name, *_ in OWN_MODELS[1:]:
        ways[name] = {"wrench_map": replace(fitted, coefficients=validation.final.by_model[name]).on_board()}
    calls = {key: partial(biotac.compute, counts, run.tare, pdc_above_rest=0.0, **how) for key, how in ways.items()}
    with threadpool_limits(limits=1, user_api="blas"):  # CPU time: other threads would count, other programs would not
        return timed([Contestant(key, len(counts), call) for key, call in calls.items()], ROUNDS, process_time_ns)


def _from_others(files: Sequence[Path], runs: list[Run]) -> tuple[dict[str, Population], list[str]]:
    """For each recording the map of the others; for a single one the package's map, if not trained on it."""
    if len(runs) > 1:
        fingers = [training.sums_of(training.aligned(run)) for run in runs]
        maps = training.of_others(fingers, symmetric=True)
        note = "population maps are trained on the other recordings, symmetric like the package's"
        return {path.name: others for path, others in zip(files, maps, strict=True)}, [note]
    kept = load_population(None)
    path = files[0]
    if kept.made_of([path]):
        return {}, [f"the package's population map was made from {path.name}: name another finger's recording too"]
    return {path.name: kept.population}, ["the population map is the package's"]


def _untrained(population_map: Population, run: Run) -> dict[str, list[float]]:
    found = held_out_error.worth(population_map, training.aligned(run))
    all_three = {POPULATION: found.rmse_n, PRESSES: found.rmse_scale5_n, MINUTE: found.rmse_60s_n}
    return {key: rmse.tolist() for key, rmse in all_three.items() if rmse is not None}


def _noise(validation: Validation) -> list[float]:
    """RMS effect, N, of electrode noise through the map of the whole run. Second differences leave out slow loads."""
    run, rng = validation.run, np.random.default_rng(0)
    curve = np.diff(run.counts, n=2, axis=0)
    sigma = np.median(np.abs(curve), axis=0) / 0.6745 / np.sqrt(6.0)
    rows = rng.integers(0, len(run.counts), 2000)
    pdc = None if run.pdc is None else run.pdc[rows]
    map_of_all = validation.wrench_map
    counts = run.counts[rows]
    noisy = counts + rng.normal(size=counts.shape) * sigma
    noised, exact = (map_of_all.predict(each, pdc)[:, :3] for each in (noisy, counts))
    noise_n: list[float] = rmse(noised, exact).tolist()
    return noise_n


def _repeatability(validation: Validation) -> list[float]:
    """Differences of held-out errors between rows of nearly equal counts seconds apart, which no map could explain."""
    run = validation.run
    error = validation.predicted[0][:, :3] - run.truth[:, :3]
    rows = np.arange(0, len(run.counts), EVERY_ROW)
    near, distance = _nearest(run.counts - run.tare, rows)
    same = distance <= np.quantile(distance, NEAREST)
    apart_n: list[float] = (rmse(error[rows[same]], error[near[same]]) / np.sqrt(2.0)).tolist()
    return apart_n


def _nearest(e: Floats, rows: NDArray[np.intp]) -> tuple[NDArray[np.intp], Floats]:
    """For each of ``rows`` the row nearest in counts that is at least GUARD_ROWS away, and the squared distance."""
    size, every = (e**2).sum(axis=1), np.arange(len(e))
    near, distance = np.zeros(len(rows), np.intp), np.zeros(len(rows))
    for start in range(0, len(rows), 500):
        some = rows[start : start + 500]
        squares = size[some][:, None] + size - 2.0 * e[some] @ e.T
        squares[np.abs(some[:, None] - every) < GUARD_ROWS] = np.inf
        near[start : start + 500], distance[start : start + 500] = squares.argmin(axis=1), squares.min(axis=1)
    return near, distance


def _pooled(rmse_n: dict[str, list[float]]) -> float:
    """RMS length over x y z, then the geometric mean over the recordings."""
    return float(np.exp(np.mean([np.log(np.linalg.norm(three)) for three in rmse_n.values()])))


def draw(outcome: Outcome, path: Path) -> None:
    """Write a PNG: cycles against newtons on each core, each point with its time on this computer."""
    with drawn(path) as figure:
        figure.set_size_inches(12, 6)
        for axes, (core, about) in zip(figure.subplots(1, len(CORES), sharey=True), CORES.items(), strict=True):
            for k, point in enumerate(outcome.points):
                color, at = COLORS.get(point.knows, LITTLE), (point.cycles[core], point.error_n)
                name = f"{k + 1}: {point.knows}: {point.name}, {point.host_ns:,.0f} ns"
                axes.plot(*at, "o", color=color, ms=8, label=name)
                axes.vlines(at[0], *np.quantile([np.linalg.norm(three) for three in point.rmse_n.values()], [0, 1]),
                            color=color, linewidth=1)  # fmt: skip
                axes.annotate(str(k + 1), at, xytext=(7, 4 - 10 * (k % 2)), textcoords="offset points", fontsize=9)
            for field, name, style in FLOORS:
                level = _pooled(getattr(outcome, field))
                axes.axhline(level, color="#334155", linestyle=style, linewidth=1, label=f"{name}: {level:.2f} N")
            axes.set(xscale="log", yscale="log", xlabel=f"cycles of a force, {about['title']}")
            axes.margins(x=0.25)
            axes.grid(alpha=0.25)
        figure.axes[0].set_ylabel("RMS error of the force on data not used to fit it [N]")
        figure.suptitle(
            "Cycles against newtons; lines: from recording to recording; ns: CPU time of a frame on one computer"
        )
        figure.legend(*axes.get_legend_handles_labels(), fontsize=9, loc="outside lower center", ncols=2)
