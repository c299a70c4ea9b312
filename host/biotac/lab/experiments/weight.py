"""What figures 3, 9 and 10 of Lin 2013 share: a 500 g weight with a flat surface on the pad, and its models.

The trial is emulated or a laboratory's own with a force plate; its estimates are the paper's scales and any
fitted maps; its figures are errors over the loaded frames and means over the phases in which the load rests.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...core import geometry as surface
from ...core.geometry import Floats
from ...errors import RecordingError
from ...markdown import table
from ...sim.physics import Profile
from ...sim.timeline import Pose
from ...wire import sensor_gen as _sensor
from . import laboratory
from .estimates import PAPER, Estimate, by_map, by_paper, load_maps, paper_scales, rmse
from .outcome import Facts, Options, number, numbers, text
from .trial import Bools, Script, Trial, play

WEIGHT_N = 4.905  # 500 g
FLAT_MM = 7.0  # numerics.md 3.1: a flat surface leaves a footprint of 3.5 mm radius
LOADED_N = 0.5
RAMP_S = 0.5
_E17 = surface.ELECTRODE_MM[_sensor.ELECTRODE_NAMES.index("E17")]
E17_MM = (float(_E17[0]), float(_E17[1]))  # the paper does not say where the weight lies; figure 3 has it over E17
Step = tuple[str, float, float, float]  # phase, weight N, push to +y N, torsion about the outward normal N mm
FORCES, TORQUES = ("Fx", "Fy", "Fz"), ("Mx", "My", "Mz")


@dataclass(frozen=True)
class Result:
    """A trial and what models make of it; the first of ``estimates`` is the paper's on this very trial."""

    source: str
    trial: Trial
    estimates: list[Estimate]
    scales: dict[str, dict[str, int]]
    notes: list[str]
    is_recorded: bool


def emulated(
    figure: str,
    steps: Iterable[Step],
    hold_s: float,
    seed: int,
    *,
    at_mm: tuple[float, float] = E17_MM,
    tip_mm: float = FLAT_MM,
    profile: Profile = "new",
    take: int = 0,
    noiseless: bool = False,
    mirrored: bool = False,
) -> Trial:
    """Two seconds at rest (A), then each step's load at ``at_mm``, reached in RAMP_S and held for ``hold_s``.

    ``mirrored`` is the same trial as its mirror image sees it; ``profile``, ``take`` and ``noiseless`` as of play().
    """
    side = -1.0 if mirrored else 1.0
    bare = Pose(at_mm[0], side * at_mm[1], tip_mm=tip_mm)
    script = Script()
    script.phase("A", 0.1, 1.9, bare, bare)
    for name, force_n, push_n, torsion_nmm in steps:
        end = replace(bare, force_n=force_n, shear_y_n=side * push_n, torsion_nmm=side * torsion_nmm)
        script.phase(name, RAMP_S, hold_s, end)
    return play(figure, script, seed=seed, profile=profile, take=take, noiseless=noiseless, mirrored=mirrored)


def run(
    options: Options,
    emulate: Callable[[int], Trial],
    how: str,
    *,
    torque: bool,
    before: Callable[[int], Sequence[Trial]] = lambda seed: (),
) -> Result:
    """On an emulated finger by its seed, loaded ``how``; or on a recording with F, and M for ``torque``."""
    if options.recording is not None:
        return _of_recording(options, torque=torque)
    seed = options.seed
    notes = [f"emulated sensor, new, seed {seed}: {WEIGHT_N:.1f} N over E17, {how}"]
    return _estimated(f"emulated finger, seed {seed}", emulate(seed), options, notes, before(seed), is_recorded=False)


def _of_recording(options: Options, *, torque: bool) -> Result:
    assert options.recording is not None
    theirs = laboratory.load(options.recording, options.finger, needs=("F", "M") if torque else ("F",))
    assert theirs.trial.force_n is not None
    if not np.isfinite(theirs.trial.tare).any():
        raise RecordingError(
            f"{options.recording}: the board never finds a tare in it: expected the finger still and untouched at the "
            f"start; add E_base"
        )
    if not loaded(theirs.trial).any():
        most = np.linalg.norm(theirs.trial.force_n, axis=1).max()
        raise RecordingError(
            f"{options.recording}: never loaded, the most is {most:.2f} N: expected over {LOADED_N:g} N; is F in N?"
        )
    notes = [*theirs.notes, "phases are not looked for in a recording: its errors are over all loaded frames"]
    return _estimated(str(options.recording), theirs.trial, options, notes, is_recorded=True)


def _estimated(
    source: str, trial: Trial, options: Options, notes: list[str], before: Sequence[Trial] = (), *, is_recorded: bool
) -> Result:
    """The paper's scales fitted on the trial itself, on the trials ``before`` it, and the maps of the options."""
    maps = load_maps(options.maps)
    on_this = paper_scales([trial])
    scaled, own = by_paper(trial, on_this, PAPER)
    scales = {PAPER: on_this}
    estimates = [own]
    notes = [
        *notes,
        f"{PAPER}: one scale an axis, least squares on this very trial, which is the best they can do; an axis without "
        "load keeps the board's default",
    ]
    if trial.torque_nmm is not None:
        notes.append("the board has no scale for Mx, which the electrodes hardly see: it publishes the force's lever")
    if before:
        name = f"{PAPER}, scaled before"
        scales[name] = paper_scales(before)
        estimates.append(by_paper(trial, scales[name], name)[1])
        notes.append(f"{name}: the same fitted on {' and '.join(t.name for t in before)} of the same finger instead")
    for name, (path, its) in maps.items():
        estimates.append(by_map(scaled, its, name))
        more = "; torsion is an axis of its own" if "torsion" in its.axes else ""
        notes.append(f"{name}: {its.model}, {path}{more}")
    named = {name: {setting.name.lower(): value for setting, value in these.items()} for name, these in scales.items()}
    return Result(source, scaled, estimates, named, notes, is_recorded)


def loaded(trial: Trial) -> Bools:
    """Frames (n,) with more than LOADED_N of true force and a tare."""
    assert trial.force_n is not None
    tared = np.isfinite(trial.tare).all(axis=1)
    return np.asarray((np.linalg.norm(trial.force_n, axis=1) > LOADED_N) & tared)


def poc_mm(trial: Trial) -> Floats:
    """The board's own points of contact (n, 3)."""
    points: Floats = trial.frames["poc_mm"]
    return points


def facts_of(result: Result, name: str) -> Facts:
    """What the figures of all three have in common."""
    trial, rows = result.trial, loaded(result.trial)
    models: Facts = {}
    for its in result.estimates:
        one: Facts = {"rmse_n": numbers(rmse(its.force_n, trial.force_n, rows))}
        if trial.torque_nmm is not None and its.torque_nmm is not None:
            one["rmse_nmm"] = numbers(rmse(its.torque_nmm, trial.torque_nmm, rows))
            assert trial.at_mm is not None
            for what, at_mm in (("torsion", trial.at_mm), ("torsion_at_poc", poc_mm(trial))):
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
    """Errors over the loaded frames, a model a row."""
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
        "The paper draws this trial and gives no numbers, so what stands against it is its model on the same counts.",
        f"RMSE over {facts['loaded_frames']} loaded frames (true force above {LOADED_N:g} N).",
    ]
    if torque:
        lines.append(
            "Torsion is about the contact's normal, (M - c x F) . n: at the true contact, and at the point of contact "
            "the board itself publishes."
        )
    return [*lines, "", *table(head, rows)]


def phases_table(facts: Facts, axes: Sequence[str]) -> list[str]:
    """Means over each phase, what was applied beside every model."""
    if not facts["phases"]:
        return []
    names = ["applied", *facts["models"]]
    rows = []
    for phase in facts["phases"]:
        both = {"applied": phase["applied"], **phase["models"]}
        rows.append([phase["name"], *[text(both[name].get(axis), 2) for axis in axes for name in names]])
    units = {axis: "N" if axis in FORCES else "N mm" for axis in axes}
    head = ["phase", *[f"{axis} {name} [{units[axis]}]" for axis in axes for name in names]]
    return ["Means over the part of each phase in which the load rests.", "", *table(head, rows)]
