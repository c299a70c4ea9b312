"""What figures 3, 9 and 10 of Lin 2013 share: a 500 g weight with a flat surface on the pad, and the models.

The trial is emulated or a laboratory's own with a force plate. Estimates are by the paper's scales and by any fitted
maps. Figures are errors over the loaded frames, and means over the phases in which the load is at rest.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...core import geometry as surface
from ...core.geometry import Floats
from ...errors import RecordingError
from ...markdown import table
from ...sim.scenario import FLAT_MM
from ...sim.timeline import Pose
from ...wire import sensor_gen as _sensor
from . import laboratory
from .estimates import PAPER, Estimate, by_map, by_paper, load_maps, paper_scales, rmse
from .outcome import Facts, Options, number, numbers, text
from .trial import Bools, Script, Trial, play

WEIGHT_N = 4.905  # 500 g
LOADED_N = 0.5
RAMP_S = 0.5
_E17 = surface.ELECTRODE_MM[_sensor.ELECTRODE_NAMES.index("E17")]
E17_MM = (float(_E17[0]), float(_E17[1]))  # the paper does not say where the weight lies; in figure 3 it is over E17
Step = tuple[str, float, float, float]  # phase, weight N, push to +y N, torsion about the outward normal N mm
FORCES, TORQUES = ("Fx", "Fy", "Fz"), ("Mx", "My", "Mz")


@dataclass(frozen=True)
class Result:
    """A trial and the models' estimates; the first of ``estimates`` is by the paper's scales fitted to this trial."""

    source: str
    trial: Trial
    estimates: list[Estimate]
    scales: dict[str, dict[str, int]]
    notes: list[str]


def emulated(
    figure: str,
    steps: Iterable[Step],
    hold_s: float,
    seed: int,
    *,
    at_mm: tuple[float, float] = E17_MM,
    tip_mm: float = FLAT_MM,
    mirrored: bool = False,
    **finger: Any,
) -> Trial:
    """Two seconds at rest (A), then each step's load at ``at_mm``, reached in RAMP_S and held for ``hold_s``.

    ``mirrored`` is the same trial seen in a mirror; ``finger`` has profile, take and noiseless as for play().
    """
    side = -1.0 if mirrored else 1.0
    bare = Pose(at_mm[0], side * at_mm[1], tip_mm=tip_mm)
    script = Script()
    script.phase("A", 0.1, 1.9, bare, bare)
    for name, force_n, push_n, torsion_nmm in steps:
        end = replace(bare, force_n=force_n, shear_y_n=side * push_n, torsion_nmm=side * torsion_nmm)
        script.phase(name, RAMP_S, hold_s, end)
    return play(figure, script, seed=seed, mirrored=mirrored, **finger)


def run(
    options: Options,
    emulate: Callable[[int], Trial],
    how: str,
    *,
    torque: bool,
    before: Sequence[Callable[[int], Trial]] = (),
) -> Result:
    """Run on an emulated finger by its seed, loaded as ``how`` says, after the trials ``before``, or on a recording.

    A recording needs F and, for ``torque``, M. The estimates are by the paper's scales, fitted on the trial itself and,
    separately, on those before, and by the options' maps.
    """
    maps = load_maps(options.maps)
    earlier: list[Trial] = []
    if options.recording is not None:
        source, trial = str(options.recording), _recorded(options.recording, options.finger, torque)
        notes = [*trial.notes, "a recording is not split into phases: its errors are over all loaded frames"]
    else:
        seed = options.seed
        source, trial, earlier = f"emulated finger, seed {seed}", emulate(seed), [its(seed) for its in before]
        notes = [f"emulated sensor, new, seed {seed}: {WEIGHT_N:.1f} N over E17, {how}"]
    scales = {PAPER: paper_scales([trial])}
    notes.append(
        f"{PAPER}: one scale per axis, least squares on this same trial, so this is its best case; an axis without "
        "load keeps the board's default"
    )
    if trial.torque_nmm is not None:
        notes.append(
            "the board has no scale for Mx, which the electrodes hardly sense: it computes Mx from force and point of "
            "contact"
        )
    if earlier:
        name = f"{PAPER}, scaled before"
        scales[name] = paper_scales(earlier)
        notes.append(f"{name}: the same, but fitted on {' and '.join(t.name for t in earlier)} of the same finger")
    estimates = [by_paper(trial, its, name) for name, its in scales.items()]
    for name, (path, its) in maps.items():
        estimates.append(by_map(trial, its, name))
        more = "; torsion is an axis of its own" if "torsion" in its.axes else ""
        notes.append(f"{name}: {its.model}, {path}{more}")
    named = {name: {setting.name.lower(): value for setting, value in these.items()} for name, these in scales.items()}
    return Result(source, trial, estimates, named, notes)


def _recorded(path: Path, finger: int, torque: bool) -> Trial:
    trial = laboratory.load(path, finger, needs=("F", "M") if torque else ("F",))
    assert trial.force_n is not None
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
    assert trial.force_n is not None
    tared = np.isfinite(trial.tare).all(axis=1)
    return np.asarray((np.linalg.norm(trial.force_n, axis=1) > LOADED_N) & tared)


def facts_of(result: Result, name: str) -> Facts:
    """The figures that all three experiments share."""
    trial, rows = result.trial, loaded(result.trial)
    models: Facts = {}
    for its in result.estimates:
        one: Facts = {"rmse_n": numbers(rmse(its.force_n, trial.force_n, rows))}
        if trial.torque_nmm is not None and its.torque_nmm is not None:
            one["rmse_nmm"] = numbers(rmse(its.torque_nmm, trial.torque_nmm, rows))
            assert trial.at_mm is not None
            for what, at_mm in (("torsion", trial.at_mm), ("torsion_at_poc", trial.frames["poc_mm"])):
                error = rmse(its.torsion_nmm(at_mm), trial.torsion_nmm, rows)
                one[f"{what}_rmse_nmm"] = number(float(error[0]))
        models[its.name] = one
    return {
        "experiment": name,
        "source": result.source,
        "loaded_frames": int(rows.sum()),
        "scales_nn_per_count": result.scales,
        "models": models,
        "phases": [_phase(result, k) for k in range(len(trial.phases))],
        "checks": [],
        "notes": result.notes,
    }


def _phase(result: Result, k: int) -> Facts:
    trial = result.trial
    phase = trial.phases[k]
    rows = trial.during(phase)
    assert trial.force_n is not None and trial.torque_nmm is not None and trial.torsion_nmm is not None
    assert trial.at_mm is not None
    signal = trial.signal[rows].mean(axis=0)
    means: Facts = {
        "name": phase.name,
        "counts": dict(zip(_sensor.ELECTRODE_NAMES, numbers(signal), strict=True)),
        "applied": _means(trial.force_n[rows], trial.torque_nmm[rows], trial.torsion_nmm[rows]),
        "models": {},
    }
    for its in result.estimates:
        torque = None if its.torque_nmm is None else its.torque_nmm[rows]
        turned = its.torsion_nmm(trial.at_mm)
        means["models"][its.name] = _means(its.force_n[rows], torque, None if turned is None else turned[rows])
    return means


def _means(force: Floats, torque: Floats | None, torsion: Floats | None) -> Facts:
    result: Facts = dict(zip(FORCES, numbers(force.mean(axis=0)), strict=True))
    if torque is not None:
        result |= dict(zip(TORQUES, numbers(torque.mean(axis=0)), strict=True))
    if torsion is not None:
        result["torsion"] = number(float(torsion.mean()))
    return result


def errors_table(facts: Facts) -> list[str]:
    """Errors over the loaded frames, one row per model."""
    torque = any("rmse_nmm" in its for its in facts["models"].values())
    head = ["model", *[f"{axis} [N]" for axis in FORCES]]
    head += [*[f"{axis} [N mm]" for axis in TORQUES], "torsion [N mm]", "at the board's point"] if torque else []
    rows = []
    for name, its in facts["models"].items():
        row = [name, *[text(value) for value in its["rmse_n"]]]
        if torque:
            values = [*its.get("rmse_nmm", [None] * 3), its.get("torsion_rmse_nmm"), its.get("torsion_at_poc_rmse_nmm")]
            row += [text(value, 2) for value in values]
        rows.append(row)
    lines = [
        "The paper plots this trial without numbers, so the comparison is with its model on the same counts.",
        f"RMSE over {facts['loaded_frames']} loaded frames (true force above {LOADED_N:g} N).",
    ]
    if torque:
        lines.append(
            "Torsion is about the contact's normal, (M - c x F) . n: at the true contact, and at the point of contact "
            "the board itself publishes."
        )
    return [*lines, "", *table(head, rows)]


def phases_table(facts: Facts, axes: Sequence[str]) -> list[str]:
    """Means over each phase: the applied load beside every model."""
    if not facts["phases"]:
        return []
    names = ["applied", *facts["models"]]
    rows = []
    for phase in facts["phases"]:
        both = {"applied": phase["applied"], **phase["models"]}
        rows.append([phase["name"], *[text(both[name].get(axis), 2) for axis in axes for name in names]])
    units = {axis: "N" if axis in FORCES else "N mm" for axis in axes}
    head = ["phase", *[f"{axis} {name} [{units[axis]}]" for axis in axes for name in names]]
    return ["Means over the part of each phase in which the load is held.", "", *table(head, rows)]
