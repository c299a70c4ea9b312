"""Common to figures 3, 9 and 10 of Lin 2013: a 500 g weight with a flat surface on the pad, and the models.

The trial is emulated or a laboratory's own with a force plate. Estimates are by the paper's scales and by any fitted
maps. Figures are errors over the loaded frames, and means over the phases in which the load is at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from biotac import RecordingError
from biotac.core import geometry as surface
from biotac.sim import FLAT_MM, Pose
from biotac.wire import sensor

from ..report import Facts, Options, Report, Table
from . import laboratory, traces
from .estimates import PAPER, Estimate, by_map, by_paper, load_maps, paper_scales, rmse
from .trial import Bools, Floats, Script, Trial, play

WEIGHT_N = 4.905  # 500 g
LOADED_N = 0.5
RAMP_S = 0.5
_E17 = surface.ELECTRODE_MM[sensor.ELECTRODE_NAMES.index("E17")]
E17_MM = (float(_E17[0]), float(_E17[1]))  # the paper does not say where the weight lies; in figure 3 it is over E17
Step = tuple[str, float, float, float]  # phase, weight N, push to +y N, torsion about the outward normal N mm
FORCES, TORQUES = ("Fx", "Fy", "Fz"), ("Mx", "My", "Mz")


@dataclass(frozen=True)
class Result:
    """A trial and the models' estimates; the first of ``estimates`` is by the paper's scales fitted to this trial."""

    source: str
    trial: Trial
    estimates: list[Estimate]
    papers: int  # how many of the estimates are by the paper's scales; the others are by maps
    notes: list[str]

    @property
    def maps(self) -> list[Estimate]:
        """The estimates by maps."""
        return self.estimates[self.papers :]

    def report(self, tables: list[Table], checks: list[Facts], axes: Sequence[str], title: str, marked: Sequence[str],
               **figures: Any) -> Report:  # fmt: skip
        """``tables`` after the errors, and traces of ``axes`` with the electrodes ``marked``."""

        def draw(figure: Any) -> None:
            traces.draw(self.trial, self.estimates, axes, f"{title}: {self.source}", figure, marked)

        return Report(self.source, [errors(self), *tables], checks, self.notes, draw, figures)


def emulated(
    figure: str, steps: Iterable[Step], hold_s: float, seed: int, *, at_mm: tuple[float, float] = E17_MM, **finger: Any
) -> Trial:
    """Two seconds at rest (A), then each step's load at ``at_mm``, reached in RAMP_S and held for ``hold_s``.

    ``finger`` has profile and take as for play().
    """
    bare = Pose(*at_mm, tip_mm=FLAT_MM)
    script = Script()
    script.phase("A", 0.1, 1.9, bare, bare)
    for name, force_n, push_n, torsion_nmm in steps:
        script.phase(name, RAMP_S, hold_s, replace(bare, force_n=force_n, shear_y_n=push_n, torsion_nmm=torsion_nmm))
    return play(figure, script, seed=seed, **finger)


def run(
    options: Options,
    emulate: Callable[[int], Trial],
    how: str,
    *,
    torque: bool,
    before: Sequence[Callable[[int], Trial]] = (),
) -> Result:
    """Run on an emulated finger by seed, loaded as ``how`` says, after the trials ``before``, or on a recording.

    A recording needs F and, for ``torque``, M. The estimates are by the paper's scales, fitted on the trial itself and,
    separately, on those before, and by the options' maps.
    """
    maps = load_maps(options.maps)
    earlier: list[Trial] = []
    if options.recording is not None:
        trial = _recorded(options.recording, options.finger, torque)
        notes = [*trial.notes, "a recording is not split into phases: its errors are over all loaded frames"]
    else:
        seed = options.seed
        trial, earlier = emulate(seed), [play(seed) for play in before]
        notes = [f"emulated sensor, new, seed {seed}: {WEIGHT_N:.1f} N over E17, {how}"]
    scales = {PAPER: paper_scales([trial])}
    notes.append(
        f"{PAPER}: one scale per axis, least squares on this same trial, so this is its best case; an axis without "
        "load keeps the board's default"
    )
    if trial.has_torque:
        notes.append("the board has no scale for Mx, which the electrodes hardly sense: it computes Mx from force and "
                     "point of contact")  # fmt: skip
    if earlier:
        name = f"{PAPER}, scaled before"
        scales[name] = paper_scales(earlier)
        notes.append(f"{name}: the same, but fitted on {' and '.join(t.name for t in earlier)} of the same finger")
    estimates = [by_paper(trial, settings, name) for name, settings in scales.items()]
    for name, (path, fitted) in maps.items():
        estimates.append(by_map(trial, fitted, name))
        more = "; torsion is an axis of its own" if "torsion" in fitted.axes else ""
        notes.append(f"{name}: {fitted.model}, {path}{more}")
    return Result(options.source, trial, estimates, len(scales), notes)


def _recorded(path: Path, finger: int, torque: bool) -> Trial:
    trial = laboratory.load(path, finger, needs=("F", "M") if torque else ("F",))
    if not np.isfinite(trial.tare).any():
        raise RecordingError(
            f"{path}: the board finds no tare in it: expected a still, untouched finger at the start; add E_base"
        )
    if not loaded(trial).any():
        most = np.linalg.norm(trial.force_n, axis=1).max()
        raise RecordingError(
            f"{path}: force never exceeds {most:.2f} N: expected over {LOADED_N:g} N; check that F is in N"
        )
    return trial


def loaded(trial: Trial) -> Bools:
    """Frames (n,) with more than LOADED_N of true force and a tare."""
    tared = np.isfinite(trial.tare).all(axis=1)
    return np.asarray((np.linalg.norm(trial.force_n, axis=1) > LOADED_N) & tared)


def errors(result: Result) -> Table:
    """RMSE over the loaded frames, one row per model."""
    trial, rows = result.trial, loaded(result.trial)
    torque = trial.has_torque
    head = ["model", *[f"{axis} [N]" for axis in FORCES]]
    text = [
        "The paper plots this trial without numbers, so the comparison is with its model on the same counts.",
        f"RMSE over {rows.sum()} loaded frames (true force above {LOADED_N:g} N).",
    ]
    if torque:
        head += [*[f"{axis} [N mm]" for axis in TORQUES], "torsion [N mm]", "at the board's point"]
        text.append("Torsion is about the contact's normal, (M - c x F) . n: at the true contact, and at the point of "
                    "contact the board itself publishes.")  # fmt: skip
    table: list[list[Any]] = []
    for model in result.estimates:
        row: list[Any] = [model.name, *rmse(model.force_n, trial.force_n, rows)]
        if torque:
            row += rmse(model.torque_nmm, trial.torque_nmm, rows).tolist()
            row += [
                rmse(model.torsion_nmm(at_mm), trial.torsion_nmm, rows)[0]
                for at_mm in (trial.at_mm, trial.frames["poc_mm"])
            ]
        table.append(row)
    return Table("Errors", head, table, " ".join(text))


def means(result: Result, axes: Sequence[str]) -> list[Table]:
    """Means of ``axes`` over each phase, the applied load beside every model; no table for a recording."""
    trial = result.trial
    if not trial.phases:
        return []
    each: dict[str, dict[str, Floats]] = {"applied": _axes(trial.force_n, trial.torque_nmm, trial.torsion_nmm)}
    for model in result.estimates:
        each[model.name] = _axes(model.force_n, model.torque_nmm, model.torsion_nmm(trial.at_mm))
    head = [f"{axis} {name} [{'N' if axis in FORCES else 'N mm'}]" for axis in axes for name in each]
    table = [
        [phase.name, *[_mean(each[name].get(axis), trial.during(phase)) for axis in axes for name in each]]
        for phase in trial.phases
    ]
    text = "Over the part of each phase in which the load is held."
    return [Table("Means by phase", ["phase", *head], table, text, digits=2)]


def _axes(force_n: Floats | None, torque_nmm: Floats | None, torsion_nmm: Floats | None) -> dict[str, Floats]:
    found: dict[str, Floats] = {}
    for names, values in ((FORCES, force_n), (TORQUES, torque_nmm)):
        if values is not None:
            found |= dict(zip(names, values.T, strict=True))
    return found if torsion_nmm is None else found | {"torsion": torsion_nmm}


def _mean(values: Floats | None, rows: Bools) -> float | None:
    return None if values is None else float(values[rows].mean())
