"""Electrode poking: Lin, Fishel and Loeb 2013, figures 5 and 7 and table 2.

A flat-tipped probe of 2 mm presses over each electrode in turn, released in between so that the board tares anew. The
paper gives one standard deviation of the point of contact per electrode and trial, and calls the point reliable above
1 N. It does not say how three coordinates became one number, nor which frames it used. Here it is the length,
sqrt(var x + var y + var z), of the board's published points over every frame of the contact in which the true force is
above 1 N, ramps included, unfiltered. That is the strictest reading of the paper; one coordinate alone gives less.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from biotac import PocWeights, RecordingError, Setting
from biotac.core import geometry as surface
from biotac.kernels.unroll import unroll
from biotac.sim import PROFILES, Pose, Profile
from biotac.wire import messages, sensor

from ..report import Options, Report, Table, check
from . import laboratory, poke_wrench
from .trial import Bools, Floats, Script, Trial, play

RECORDING = "E and F, or an .mcap with good scales: 19 contacts above 1 N in the order of the electrodes"

PROBE_MM = 2.0
FLOOR_N = 1.0
PEAK_N = 2.5  # as in the bundled scenario poke.toml, which is older than this measurement
SLOW_PEAK_N = 5.0
BANDS_N = ((0.25, 0.5), (0.5, 1.0), (1.0, 1.5), (1.5, 2.0), (2.0, 3.0), (3.0, 5.0))
MIN_FRAMES = 5  # fewer give no meaningful standard deviation
GAP_S = 0.1  # a shorter dip of the force does not end the contact
# the paper's averages for the two trials are 0.2269 and 0.3580; on a worn finger the worse one counts
LIMIT_MM = {"new": 0.23, "worn": 0.36, "recorded": 0.23}
SHIPPED = PocWeights(messages.SETTINGS[Setting.POC_WEIGHTS].default)
WEIGHTS = (SHIPPED, *(weights for weights in PocWeights if weights != SHIPPED))
WORDS = {
    PocWeights.ABS_N2: "all signals squared (paper)",
    PocWeights.COMPRESS_N1: "compression, n = 1",
    PocWeights.COMPRESS_N2: "compression, n = 2",
}
COLORS = {SHIPPED: "#1d4ed8", PocWeights.ABS_N2: "#c2410c", PocWeights.COMPRESS_N2: "#15803d"}
PAPER_TRIALS = ("BioTac 1", "BioTac 2", "Nano17 1", "Nano17 2")
# Table 2, mm, of those
PAPER_MM = (
    (0.0388, 0.2452, 0.1118, 0.0208, 0.3911, 0.0695, 0.0690, 0.0681, 0.1527, 0.5356, 0.0076, 0.1088, 0.6269, 0.0122,
     0.8159, 0.0057, 0.6191, 0.1643, 0.2477),
    (0.0065, 0.1911, 0.0959, 0.0157, 0.2059, 0.0585, 0.4027, 0.4383, 0.7310, 1.5708, 0.0095, 0.5052, 0.1208, 0.1038,
     0.1136, 0.0404, 1.5448, 0.2959, 0.3525),
    (0.6016, 0.3788, 0.4881, 0.5026, 3.0020, 0.5849, 0.6663, 0.3622, 0.3694, 0.4546, 0.8817, 1.0673, 1.2259, 1.6051,
     1.1535, 1.0251, 0.1842, 0.1555, 0.1491),
    (0.6112, 0.5310, 0.3337, 0.2973, 0.2133, 0.2078, 0.7474, 0.6417, 0.6289, 0.3619, 0.1037, 0.6312, 0.5566, 1.4153,
     0.2669, 0.2760, 0.0965, 3.1193, 0.4673),
)  # fmt: skip

SIDES, MIDLINE = [0, 3, 5, 10, 13, 15], [6, 9, 16, 17, 18]
TRUE_MM = surface.project(surface.ELECTRODE_MM)  # where the probe stands: over the electrode, on the core


@dataclass(frozen=True)
class Spread:
    """Statistics of the points of contact of 19 pokes.

    NaN for a poke with fewer than MIN_FRAMES; the mean of all is then NaN, too, as one over the others would flatter.

    ``std_mm`` (19,) length of the standard deviation; ``axis_std_mm`` (19,) root mean square over x, y and z;
    ``bias_mm`` (19,) from the electrode to the mean point; ``frames`` (19,).
    """

    std_mm: Floats
    axis_std_mm: Floats
    bias_mm: Floats
    frames: list[int]


@dataclass(frozen=True)
class Case:
    """One sensor and kind of weights: ``trials``, and a slow one by ``bands``; ``points_mm`` are of trial 1."""

    profile: str
    weights: PocWeights
    trials: list[Spread]
    bands: list[Spread]
    points_mm: Floats


@dataclass(frozen=True)
class Result:
    """A case per sensor and kind of weights."""

    source: str
    cases: list[Case]
    notes: list[str]
    trials: dict[str, Trial]


def spread(points_mm: Floats, contacts: Sequence[Bools]) -> Spread:
    """The spread of points (n, 3), NaN where there is none, over each electrode's frames (n,)."""
    std, axis, bias, frames = np.full((4, len(contacts)), np.nan)
    for k, rows in enumerate(contacts):
        known = points_mm[rows]
        known = known[np.isfinite(known).all(axis=1)]
        frames[k] = len(known)
        if len(known) >= MIN_FRAMES:
            variance = known.var(axis=0, ddof=1)
            std[k], axis[k] = np.sqrt(variance.sum()), np.sqrt(variance.mean())
            bias[k] = np.linalg.norm(known.mean(axis=0) - TRUE_MM[k])
    return Spread(std, axis, bias, [int(n) for n in frames])


def emulated(seed: int, profile: Profile, *, repeat: int = 0, slow: bool = False) -> Trial:
    """A trial of 19 pokes; ``slow`` rises to SLOW_PEAK_N in four seconds instead of to PEAK_N in 0.3."""
    script = Script()
    for name, (x_mm, y_mm, _) in zip(sensor.ELECTRODE_NAMES, TRUE_MM.tolist(), strict=True):
        rest = Pose(x_mm, y_mm, tip_mm=PROBE_MM)
        force_n, ramp_s, hold_s = (SLOW_PEAK_N, 4.0, 0.1) if slow else (PEAK_N, 0.3, 0.5)
        script.phase("rest", 0.1, 1.4, rest, rest)
        script.phase(name, ramp_s, hold_s, Pose(x_mm, y_mm, force_n, tip_mm=PROBE_MM))
        script.phase("release", 0.2, 0.1, rest)
    return play("poke", script, seed=seed, profile=profile, repeat=repeat)


def contacts(trial: Trial, low_n: float = FLOOR_N, high_n: float = np.inf) -> list[Bools]:
    """Frames (n,) of each of the 19 contacts in which the true force is above ``low_n`` and below ``high_n``.

    Raises RecordingError unless there are 19 contacts above FLOOR_N.
    """
    size = np.linalg.norm(trial.force_n, axis=1)
    firm = np.flatnonzero(size > FLOOR_N)
    breaks = np.flatnonzero(np.diff(trial.time_s[firm]) > GAP_S) + 1
    groups = np.split(firm, breaks) if len(firm) else []
    if len(groups) != len(sensor.ELECTRODE_NAMES):
        raise RecordingError(
            f"{trial.name}: {len(groups)} contacts above {FLOOR_N:g} N: expected {len(sensor.ELECTRODE_NAMES)}, "
            f"one poke per electrode, in order, released in between; record it again"
        )
    between = [(before[-1] + after[0]) // 2 for before, after in pairwise(groups)]
    poke = np.searchsorted(between, np.arange(len(trial)), side="left")  # lighter frames belong to the nearest poke
    return [(poke == k) & (size > low_n) & (size <= high_n) for k in range(len(groups))]


def measure(options: Options) -> Result:
    """Cases of an emulated finger, new and worn, twice each; or of a recording."""
    if options.recording is not None:
        trial = laboratory.load(options.recording, options.finger, needs=("F",), own_force=True)
        return Result(options.source, _cases("recorded", [trial], trial), list(trial.notes), {"recorded": trial})
    cases: list[Case] = []
    first: dict[str, Trial] = {}
    for profile in PROFILES:
        options.show(f"poking the {profile} sensor")
        trials = [emulated(options.seed, profile, repeat=repeat) for repeat in (0, 1)]
        slow = emulated(options.seed, profile, repeat=2, slow=True)
        cases += _cases(profile, trials, slow)
        first[profile] = trials[0]
    notes = [
        f"emulated sensor, seed {options.seed}: the probe presses with up to {PEAK_N:g} N for half a second; by force: "
        f"it ramps up to {SLOW_PEAK_N:g} N in four seconds, 24 frames per 0.3 N",
        "probe placed exactly; by hand it is not, which adds to the paper's bias but not to its deviation",
        "new: noise 1.5 counts, 3 to 5 kOhm, as in the paper; worn: noise 5 counts, glitches, as in public recordings",
    ]
    return Result(options.source, cases, notes, first)


def _cases(profile: str, trials: list[Trial], slow: Trial) -> list[Case]:
    """One case for each kind of weights."""
    firm = [contacts(trial) for trial in trials]
    banded = [contacts(slow, *band) for band in BANDS_N]
    cases = []
    for weights in WEIGHTS:
        settings = {Setting.POC_WEIGHTS: int(weights)}
        points = [trial.again(settings).frames["poc_mm"] for trial in trials]
        slow_points = slow.again(settings).frames["poc_mm"]
        spreads = [spread(p, rows) for p, rows in zip(points, firm, strict=True)]
        bands = [spread(slow_points, rows) for rows in banded]
        cases.append(Case(profile, weights, spreads, bands, points[0][np.any(firm[0], axis=0)]))
    return cases


def run(options: Options) -> Report:
    """Means, by force, and table 2; on an emulated finger, new and worn, twice each, or on a recording."""
    result = measure(options)
    checks = [
        check(f"mean standard deviation above {FLOOR_N:g} N, {case.profile} sensor, trial {k}", trial.std_mm.mean(),
              LIMIT_MM[case.profile], "mm")
        for case in result.cases if case.weights == SHIPPED for k, trial in enumerate(case.trials, start=1)
    ]  # fmt: skip
    return Report(result.source, _tables(result), checks, result.notes, lambda figure: _draw(result, figure))


def _tables(result: Result) -> list[Table]:
    rows: list[list[Any]] = [
        [case.profile, called(case.weights), k, trial.std_mm.mean(), trial.axis_std_mm.mean(), trial.bias_mm.mean()]
        for case in result.cases
        for k, trial in enumerate(case.trials, start=1)
    ]
    paper = [float(np.mean(column)) for column in PAPER_MM]
    rows += [["paper", PAPER_TRIALS[k].rstrip("12 "), k % 2 + 1, mean, None, None] for k, mean in enumerate(paper)]
    head = ["sensor", "weights", "trial", "std [mm]", "per coordinate [mm]", "bias [mm]"]
    text = (
        "Standard deviation of the point of contact, sqrt(var x + var y + var z), over every frame with a force above "
        f"{FLOOR_N:g} N, mean over the 19 electrodes. Bias: from the electrode to the mean point."
    )
    bands = [f"{low:g} to {high:g} N" for low, high in BANDS_N]
    banded: list[list[Any]] = [
        [case.profile, called(case.weights), name, *[getattr(band, field).mean() for band in case.bands]]
        for case in result.cases
        for name, field in (("std", "std_mm"), ("bias", "bias_mm"))
    ]
    shipped = [case for case in result.cases if case.weights == SHIPPED]
    columns = [trial.std_mm.tolist() for case in shipped for trial in case.trials] + [list(row) for row in PAPER_MM]
    names = [f"{case.profile} {k + 1}" for case in shipped for k in range(len(case.trials))]
    each: list[list[Any]] = [[name, *row] for name, *row in zip(sensor.ELECTRODE_NAMES, *columns, strict=True)]
    each.append(["**average**", *[float(np.mean(column)) for column in columns]])
    head2 = ["electrode", *names, *[f"paper {name}" for name in PAPER_TRIALS]]
    return [
        Table("Point of contact", head, rows, text),
        Table("By force", ["sensor", "weights", "mm", *bands], banded, "Within each band, means over the electrodes."),
        Table("Table 2, with the board's default weights", head2, each, "In mm.", digits=4),
        *_by_electrode(shipped),
        poke_wrench.table(result.trials, {name: contacts(trial) for name, trial in result.trials.items()}),
    ]


def _by_electrode(shipped: list[Case]) -> list[Table]:
    """How far the new sensor's rows of table 2 agree with the paper's, one by one."""
    new = [trial.std_mm for case in shipped if case.profile == PROFILES[0] for trial in case.trials]
    if len(new) < 2:
        return []
    paper = np.array(PAPER_MM[:2])
    apart = np.abs(paper[0] - paper[1])
    rows: list[list[Any]] = [
        [f"trial {k + 1}", int((np.abs(ours - his) <= apart).sum()),
         float(np.corrcoef(np.log(ours), np.log(his))[0, 1]), float(ours[SIDES].mean()), float(ours[MIDLINE].mean())]
        for k, (ours, his) in enumerate(zip(new, paper, strict=True))
    ]  # fmt: skip
    rows += [[f"paper, {k + 1}", None, None, his[SIDES].mean(), his[MIDLINE].mean()] for k, his in enumerate(paper)]
    head = ["table 2", "within", "correlation", "sides [mm]", "midline [mm]"]
    text = (
        "New sensor: rows off by no more than the paper's two trials differ there; correlation of the logs; means of "
        "E1, E4, E6, E11, E14, E16 and of E7, E10, E17 to E19."
    )
    return [Table("Electrode by electrode", head, rows, text)]


def called(weights: PocWeights) -> str:
    """The weights, in words."""
    return WORDS[weights] + (" (default)" if weights == SHIPPED else "")


def _draw(result: Result, figure: Any) -> None:
    """Figure 7 unrolled for the default and the paper's weights, and table 2 as bars."""
    figure.set_size_inches(15, 13)
    grid = figure.add_gridspec(3, 2, height_ratios=(1.25, 1.0, 0.7))
    first = result.cases[0].profile
    for k, weights in enumerate((SHIPPED, PocWeights.ABS_N2)):
        cases = [case for case in result.cases if case.weights == weights]
        _draw_points(figure.add_subplot(grid[0, k]), next(case for case in cases if case.profile == first))
    _draw_electrodes(figure.add_subplot(grid[1, :]), result)
    trial = next(iter(result.trials.values()))
    poke_wrench.draw(trial, contacts(trial), [figure.add_subplot(grid[2, k]) for k in (0, 1)])
    figure.suptitle(f"Electrode poking, 2 mm probe, above {FLOOR_N:g} N: {result.source}")


def _draw_points(axes: Any, case: Case) -> None:
    across, along = unroll(TRUE_MM)
    points_across, points_along = unroll(case.points_mm[np.isfinite(case.points_mm).all(axis=1)])
    axes.plot(points_across, points_along, ".", color="#1d4ed8", markersize=3, alpha=0.4, label="point of contact")
    axes.plot(across, along, "o", markersize=13, markerfacecolor="none", color="#111111", label="electrode")
    for name, a, b in zip(sensor.ELECTRODE_NAMES, across, along, strict=True):
        axes.annotate(name, (a, b), xytext=(0, 9), textcoords="offset points", ha="center", fontsize=7.5)
    axes.set(xlabel="around the finger [mm], + towards E11", ylabel="along the finger [mm], tip up", aspect="equal")
    axes.set_title(f"{case.profile}: {WORDS[case.weights]}", fontsize=10)
    axes.margins(0.08)
    axes.grid(alpha=0.25)
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2)


def _draw_electrodes(axes: Any, result: Result) -> None:
    shipped = [case for case in result.cases if case.weights == SHIPPED]
    colors = iter(("#1d4ed8", "#60a5fa", "#15803d", "#86efac"))
    series = [
        (f"{case.profile}, trial {k}", trial.std_mm, next(colors))
        for case in shipped
        for k, trial in enumerate(case.trials, start=1)
    ]
    series += [(f"paper, trial {k + 1}", np.array(PAPER_MM[k]), color) for k, color in ((0, "#57534e"), (1, "#a8a29e"))]
    x, width = np.arange(len(sensor.ELECTRODE_NAMES)), 0.84 / len(series)
    for k, (label, std, color) in enumerate(series):
        at = x + (k - (len(series) - 1) / 2) * width
        axes.bar(at, std, width, color=color, label=f"{label}: {std.mean():.3f}")
    axes.axhline(LIMIT_MM["new"], color="#111111", linewidth=1, linestyle=":")
    axes.set_xticks(x, sensor.ELECTRODE_NAMES)
    axes.set(ylabel="std of the point of contact [mm]", yscale="log", xlim=(-0.6, 18.6))
    axes.set_title("table 2, with the board's default weights; mean of the 19 in the legend", fontsize=10)
    axes.grid(alpha=0.25, axis="y")
    axes.legend(fontsize=8, ncols=len(series), loc="upper center", bbox_to_anchor=(0.5, -0.1))
