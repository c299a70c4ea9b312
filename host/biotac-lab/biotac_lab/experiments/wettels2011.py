"""Every table and figure of Wettels and Loeb 2011, on an emulated finger and on recordings with their force.

The paper's probes, places and presses are drawn by learn/stimulations.py. Models are tested on contacts that were not
in training. Beside that stands the paper's own split, rows at random, which puts neighbours in time on both sides: the
gain over held-out contacts is leakage, not a finding.
"""

from __future__ import annotations

import os
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from sklearn.exceptions import ConvergenceWarning
from threadpoolctl import threadpool_limits

from biotac.sim import SimFinger

from ..learn.probes import PROBES
from ..report import Facts, Options, Report, check, claim
from . import seeds
from .trial import Floats
from .wettels import force, more, paf, roc
from .wettels.tables import EQUATION, PAPER_PLACES, details, paf_row, text

ACCEPTS = ("real", "quick", "filter")

ROC_ASKED, D_ASKED_MM, R_ASKED_MM, BAR_ASKED_DEG = 0.947, 2.3, 2.2, 5.0


@dataclass(frozen=True)
class Size:
    """The size of a run: contacts per probe, rows, and training steps of a net."""

    places: tuple[int, ...] = (400, 400, 400, 400)
    paf_places: tuple[int, ...] = PAPER_PLACES
    frames: int = 3000
    steps: int = 1000
    frame_steps: int = 200
    his_frames: int = 60
    his_rows: int = 4000
    his_steps: int = 1000  # more than it needs: the rows set aside stop it, as in the paper
    force_places: tuple[int, ...] = (150, 150, 150, 150)
    force_steps: int = 400
    reduced_places: tuple[int, ...] = (60, 60, 60, 60)
    reduced_steps: int = 200
    bars: int = 3000
    bar_steps: int = 400
    pairs: int = 200


QUICK = Size(
    (8, 8, 8, 8), (3, 3, 3, 3), 300, 20, 20, 24, 300, 5, (6, 6, 6, 6), 20, (6, 6, 6, 6), 10, 200, 20, 20
)  # fmt: skip


@dataclass(frozen=True)
class Result:
    """``paf`` has figure 8's curves: truth, raw and smoothed (n, 2); ``force`` is truth and estimate (n, 3)."""

    source: str
    parts: Facts
    notes: list[str]
    paf: Any = field(repr=False)
    force: tuple[Floats, Floats] = field(repr=False)


def run(options: Options) -> Report:
    """Run it, for minutes, as host/biotac-lab/docs/learning.md says."""
    size = QUICK if options.quick else Size()
    # the nets are many small systems, on which BLAS's own threads would only wait for each other
    with threadpool_limits(limits=1, user_api="blas"), warnings.catch_warnings():
        warnings.simplefilter("ignore", ConvergenceWarning)  # of the quicker trainer, with a limited number of steps
        with ThreadPoolExecutor(min(2, os.cpu_count() or 1)) as pool:
            result = _run(options, size, pool)
    return Report(
        result.source, details(result.parts), _checks(result.parts), result.notes,
        lambda figure: _draw(result, figure), result.parts,
    )  # fmt: skip


def _run(options: Options, size: Size, pool: ThreadPoolExecutor) -> Result:
    # This imports polars, if that is installed, and scikit-learn fails in another thread meanwhile.
    import statsmodels.nonparametric.smoothers_lowess  # noqa: F401

    finger, seed = SimFinger(options.seed), options.seed
    rows = force.load(finger, size.force_places, seed)
    less = force.load(finger, size.reduced_places, seed)
    steps = size.force_steps
    options.show("simulating presses and training nets")
    nets = pool.submit(force.networks, rows, steps, seed)
    by_contact = pool.submit(roc.frames, finger, size.places, seed, size.frame_steps, size.frames)
    his_steps = size.his_steps, size.frame_steps
    by_row = [
        pool.submit(roc.his_rows, finger, PAPER_PLACES, seed, his_steps, k * size.his_frames, k * size.his_rows,
                    options.filter)
        for k in (1, 2)
    ]  # fmt: skip
    table4 = pool.submit(force.table4, rows, seed, size.his_steps)
    grown = pool.submit(roc.trajectories, finger, size.places, seed, size.steps)
    bars = pool.submit(more.bars, finger, size.bars, seed, size.bar_steps)
    reduced = pool.submit(force.reductions, less, size.reduced_steps, seed)
    pairs = pool.submit(more.pairs, finger, size.pairs, seed)
    real = [pool.submit(force.recorded, path, steps, seed, options.show) for path in options.real]
    table3, drawn = paf.run(finger, size.paf_places, seed, options.filter)
    estimates = nets.result()
    parts = {
        "paf": table3,
        "impedance": paf.impedance(finger),
        "correlations": paf.correlations(finger, PAPER_PLACES, seed),
        "roc": [*by_row[0].result(), by_row[1].result()[0], by_contact.result(), *grown.result()],
        "force": [{"how": how} | force.scores(own, rows.force_n) for how, own in estimates.items()],
        "force_places": list(size.force_places),
        "classes": force.by_class(estimates[force.A_PRIORI], rows),
        "table4": table4.result(),
        "reductions": reduced.result(),
        "pairs": pairs.result(),
        "bars": bars.result(),
        "real": [net.result() for net in real],
    }
    notes = [
        f"emulated finger, seed {seed}: Hertzian footprints, like a BioTac but no particular one",
        f"contacts of five presses per probe, 30 to 40 N (paper: {PAPER_PLACES}): {size.paf_places} for PAF, "
        f"{size.places} for curvature, {size.force_places} for force, {size.reduced_places} for figure 10",
        "the paper's 3-pole 5 Hz low-pass on figure 7's rows and table 3"
        if options.filter
        else "no filter (--filter: the paper's 3-pole 5 Hz low-pass, which lags by 64 ms)",
        "R2 is the squared correlation, as its table 3 needs; % is Eq 6 as a ratio of integrals, only where the force "
        "is above 1 N, and beside it Eq 6 as printed, which diverges",
        "inputs are divided by the deviation: dividing them by the variance before changes nothing, as the nets scale "
        "their inputs, as MATLAB's do",
        "rear or forward by the true place, the probe known, as in the paper; then by PAF's own d; then the probe by "
        "the classifier, too",
    ]
    if options.quick:
        notes.append("--quick: far too few rows for the figures to mean anything")
    return Result(options.source, parts, notes, drawn, (rows.force_n, estimates[force.A_PRIORI]))


def _checks(parts: Facts) -> list[Facts]:
    firm = paf_row(parts, EQUATION, "force threshold")
    best = roc.chosen(parts["roc"])
    single, four = parts["force"][0]["pooled_n"], parts["force"][1]["pooled_n"]
    return [
        check("PAF d above 1 N, the paper's loads", firm["d"]["rmse"], D_ASKED_MM, "mm"),
        check("PAF r above 1 N, the paper's loads", firm["r"]["rmse"], R_ASKED_MM, "mm"),
        check(
            f"probes misclassified, held out, by {best['what']}, chosen on other contacts",
            1 - best["correct"],
            1 - ROC_ASKED,
            "of all",
        ),
        claim(f"nets by class beat one net, pooled RMSE {text(four)} against {text(single)} N", four < single),
        check("direction of a bar, RMSE", parts["bars"]["rmse_deg"], BAR_ASKED_DEG, "deg"),
        *seeds.findings("wettels2011", parts),
    ]


def _draw(result: Result, figure: Any) -> None:
    """Figures 6, 7, 8 and 12."""
    figure.set_size_inches(15, 11)
    grid = figure.add_gridspec(3, 2)
    truth, raw, smooth = result.paf
    for k, name in enumerate(("d", "r")):
        axes = figure.add_subplot(grid[0, k])
        axes.plot(raw[:, k], ".", markersize=1.5, color="#93c5fd", label="Eq 5")
        axes.plot(smooth[:, k], ".", markersize=1.5, color="#1d4ed8", label="above 1 N, LOWESS")
        axes.plot(truth[:, k], color="#dc2626", linewidth=0.8, label="true")
        axes.set(title=f"figures 8 and 9: {name} [mm]", xlabel="row")
        axes.legend(fontsize=7, loc="lower right")
    axes = figure.add_subplot(grid[1, 0])
    found = np.array(result.parts["correlations"], dtype=float)
    for k, (name, color) in enumerate(zip(("x", "y", "z"), ("#dc2626", "#15803d", "#1d4ed8"), strict=True)):
        axes.bar(np.arange(1, 20) + 0.27 * (k - 1), found[:, k], 0.27, color=color, label=f"F{name}")
    axes.set(title="figure 6: Spearman coefficient of each electrode", xticks=range(1, 20))
    axes.legend(fontsize=7)
    axes = figure.add_subplot(grid[1, 1])
    confusion = np.array(result.parts["roc"][-1]["confusion"])
    axes.imshow(confusion, cmap="Blues")
    for (row, column), value in np.ndenumerate(confusion):
        axes.text(column, row, str(value), ha="center", va="center", fontsize=8)
    names = [probe.name for probe in PROBES]
    axes.set(xticks=range(4), yticks=range(4), xticklabels=names, yticklabels=names, xlabel="true", ylabel="found")
    axes.set_title(f"figure 7: by {result.parts['roc'][-1]['what']}, held out")
    inner = grid[2, :].subgridspec(1, 3)
    true, estimates = result.force
    for k, name in enumerate(("x", "y", "z")):
        axes = figure.add_subplot(inner[0, k])
        axes.plot(true[:, k], estimates[:, k], ".", markersize=1, color="#1d4ed8")
        axes.axline((0, 0), slope=1, color="#dc2626", linewidth=0.8)
        axes.set(title=f"figure 12: F{name} [N], held out", xlabel="true", ylabel="nets by class")
