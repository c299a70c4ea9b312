"""The normal at the point of contact against that of a flat plate, with the board's default weights and nothing fitted.

A flat plate touches a convex finger where the finger's outward normal is the plate's. In the recording the plate's
normal was measured (motion capture, trial_15330 of Robotic-Finger). Every frame in contact counts: the board says so
and PDC is more than CONTACT_COUNTS above the board's rest, which on that sensor is more than 2000 count^2 of signal;
figures for other thresholds are given, too. To tell the formula's error from the sensor's, the figures also give the
error left after correcting the normal by other contacts of the same recording.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from biotac import InputError, PocWeights, RecordingError, Setting
from biotac.calibrate import wrench
from biotac.core import geometry as surface
from biotac.sim import FLAT_MM, Pose, Profile

from ..calibrate import normal
from ..report import Options, Report, Table, check
from . import laboratory
from .poke import COLORS, SHIPPED, WEIGHTS, WORDS, called
from .trial import Bools, Floats, Script, Trial, play

RECORDING = "E, PDC and z_dir, a plate's unit normal"

CONTACT_COUNTS = 40.0
THRESHOLDS_COUNTS = (0.0, 20.0, 40.0, 80.0, 200.0)
LIMIT_MEDIAN_DEG, LIMIT_P90_DEG = 8.9, 14.7
# the same trial in float64, median and 90th percentile
KNOWN_DEG = {PocWeights.ABS_N2: (21.1, 56.6), PocWeights.COMPRESS_N1: (8.7, 14.7), PocWeights.COMPRESS_N2: (11.0, 19.4)}
EMULATED_CONTACTS = 40
APART_ROWS = 15  # frames without contact that separate two contacts


@dataclass(frozen=True)
class Angles:
    """Degrees between the point's normal and the plate's for one kind of weights, by frame; NaN without a point."""

    profile: str
    weights: PocWeights
    angle_deg: Floats
    touched: Bools
    pressure: Floats

    def over(self, threshold_counts: float) -> Floats:
        """Angles of the frames in contact with more pressure than that; a frame without a point counts as 180 deg."""
        rows = self.touched & (self.pressure > threshold_counts)
        # leaving such frames out would reward weights that often give no point
        return np.nan_to_num(self.angle_deg[rows], nan=180.0)


def angles_deg(points_mm: Floats, normals: Floats) -> Floats:
    """Angles between the core's outward normals at points (n, 3) and unit normals (n, 3); NaN without a point."""
    known = np.asarray(np.isfinite(points_mm).all(axis=1))
    outward = surface.normals_at(np.where(known[:, None], points_mm, [0.0, 0.0, -1.0]))
    return np.where(known, wrench.angles_deg(outward, normals), np.nan)


def emulated(seed: int, profile: Profile) -> Trial:
    """A trial of a flat plate pressed from EMULATED_CONTACTS directions with 1 to 6 N, released in between."""
    rng = np.random.default_rng([seed, 15330])
    script = Script()
    for k in range(EMULATED_CONTACTS):
        x_mm, roll_rad, force_n = rng.uniform(-12.0, 3.5), rng.uniform(-1.0, 1.0), rng.uniform(1.0, 6.0)
        ring_mm = np.sqrt(surface.RADIUS_MM**2 - max(x_mm, 0.0) ** 2)
        rest = Pose(x_mm, float(ring_mm * np.sin(roll_rad)), tip_mm=FLAT_MM)
        script.phase("rest", 0.1, 1.4, rest, rest)
        script.phase(f"press {k + 1}", 0.5, 1.0, Pose(rest.x_mm, rest.y_mm, force_n, tip_mm=FLAT_MM))
        script.phase("release", 0.3, 0.2, rest)
    trial = play("plate-normal", script, seed=seed, profile=profile)
    contact = np.where(np.isfinite(trial.at_mm), trial.at_mm, [0.0, 0.0, -surface.RADIUS_MM])
    return replace(trial, plate_normal=surface.normals_at(contact))


def looks(trial: Trial) -> normal.Looks:
    """Frames in contact with a point, by CONTACT_COUNTS and the default weights, and the plate's normals there."""
    points = trial.again({Setting.POC_WEIGHTS: int(SHIPPED)}).frames["poc_mm"]
    known = np.isfinite(points).all(axis=1) & np.isfinite(trial.signal).all(axis=1)
    rows = np.flatnonzero(trial.touched & (trial.pressure > CONTACT_COUNTS) & known)
    contact = np.concatenate([[0], np.cumsum(np.diff(rows) > APART_ROWS)])[: len(rows)]
    return normal.Looks(points[rows], trial.signal[rows], trial.plate_normal[rows], contact)


def _corrected(trial: Trial) -> Floats:
    seen = looks(trial)
    return wrench.angles_deg(normal.held_out(seen), seen.normals)


def _case(profile: str, weights: PocWeights, trial: Trial) -> Angles:
    points = trial.again({Setting.POC_WEIGHTS: int(weights)}).frames["poc_mm"]
    return Angles(profile, weights, angles_deg(points, trial.plate_normal), trial.touched, trial.pressure)


def run(options: Options) -> Report:
    """Angles at the threshold that counts, then at the others; on an emulated finger, new and worn, or a recording.

    Each contact is corrected by the others, too.
    """
    trials = laboratory.trials(options, emulated, "pressing a plate on", ("PDC", "z_dir"))
    notes = [
        f"emulated sensor, seed {options.seed}: {EMULATED_CONTACTS} presses of a {FLAT_MM:g} mm flat, 1 to 6 N, x -12 "
        "to 3.5 mm, up to 57 deg of roll, no shear; a real plate also rubs, so a laboratory's angles are larger"
    ]
    if "recorded" in trials:
        notes = list(trials["recorded"].notes)
    cases: list[Angles] = []
    corrected: dict[str, Floats] = {}
    for profile, trial in trials.items():
        cases += [_case(profile, weights, trial) for weights in WEIGHTS]
        if not len(cases[-1].over(CONTACT_COUNTS)):
            raise RecordingError(
                f"{options.recording}: PDC is never {CONTACT_COUNTS:g} counts above rest in contact: expected "
                f"presses; check that PDC is in counts"
            )
        try:
            corrected[profile] = _corrected(trial)
        except InputError as error:
            notes.append(f"no correction: {error}")
    shipped = next(case for case in cases if case.weights == SHIPPED)
    angles = shipped.over(CONTACT_COUNTS)
    checks = [
        check(f"{name}, default weights, {shipped.profile}", float(np.percentile(angles, q)), limit, "deg")
        for name, q, limit in (("median", 50, LIMIT_MEDIAN_DEG), ("90th percentile", 90, LIMIT_P90_DEG))
    ]
    rows = [[case.profile, called(case.weights), *_summary(case.over(CONTACT_COUNTS))] for case in cases]
    rows += [
        [profile, "default, each contact corrected by the others", *_summary(angles)]
        for profile, angles in corrected.items()
    ]
    others: list[list[Any]] = [
        [case.profile, called(case.weights), name, *[_summary(case.over(counts))[k] for counts in THRESHOLDS_COUNTS]]
        for case in cases
        for name, k in (("median", 1), ("90th percentile", 3))
    ]
    text = (
        "Angle between the normal at the board's point of contact and the plate's, degrees, over every frame in "
        f"contact with PDC more than {CONTACT_COUNTS:g} counts above rest. Frames without a point count as 180."
    )
    if options.recording is not None:
        known = [f"{WORDS[weights]}: {median:g} / {p90:g}" for weights, (median, p90) in KNOWN_DEG.items()]
        text += f" trial_15330 in float64 with a tare of its own, median / 90th percentile: {'; '.join(known)}."
    head = ["sensor", "weights", "frames", "median", "mean", "90th percentile"]
    thresholds = ["sensor", "weights", "deg", *[f"> {counts:g} counts" for counts in THRESHOLDS_COUNTS]]
    tables = [Table("Angles", head, rows, text, digits=2), Table("Other thresholds", thresholds, others, digits=1)]
    return Report(options.source, tables, checks, notes, lambda figure: _draw(options.source, cases, figure))


def _summary(angles: Floats) -> list[Any]:
    """Frames, median, mean and 90th percentile."""
    if not len(angles):
        return [0, None, None, None]
    median, p90 = np.percentile(angles, (50, 90)).tolist()
    return [len(angles), median, float(angles.mean()), p90]


def _draw(source: str, cases: list[Angles], figure: Any) -> None:
    """Cumulative shares of frames by angle, and angles against pressure for the default weights."""
    figure.set_size_inches(13, 5.4)
    axes = figure.subplots(1, 2)
    figure.suptitle(f"Normal at the point of contact against a flat plate's: {source}")
    styles = dict(zip(dict.fromkeys(case.profile for case in cases), ("-", "--"), strict=False))
    for case in cases:
        angles = np.sort(case.over(CONTACT_COUNTS))
        label = f"{case.profile}: {WORDS[case.weights]}: {np.median(angles):.1f} / {np.percentile(angles, 90):.1f} deg"
        axes[0].plot(angles, (np.arange(len(angles)) + 0.5) / len(angles), styles[case.profile],
                     color=COLORS[case.weights], label=label)  # fmt: skip
    for share, limit in ((0.5, LIMIT_MEDIAN_DEG), (0.9, LIMIT_P90_DEG)):
        axes[0].plot(limit, share, "k>", markersize=8, label=f"required: {share:.0%} within {limit} deg")
    axes[0].set(xlabel="angle [deg]", ylabel="share of frames within this angle", xlim=(0, 60), ylim=(0, 1))
    axes[0].set_title(f"frames with PDC > rest + {CONTACT_COUNTS:g} counts; median / 90th percentile", fontsize=10)
    axes[0].legend(fontsize=8, loc="lower right")
    for case in cases:
        if case.weights in (SHIPPED, PocWeights.ABS_N2) and case.profile == cases[0].profile:
            rows = case.touched & (case.pressure > 0.0)
            axes[1].plot(case.pressure[rows], case.angle_deg[rows], ".", color=COLORS[case.weights], markersize=2,
                         alpha=0.35, label=WORDS[case.weights])  # fmt: skip
    axes[1].axvline(CONTACT_COUNTS, color="#111111", linewidth=1, linestyle=":")
    axes[1].set(xlabel="PDC above rest [counts]", ylabel="angle [deg]", xscale="log", xlim=(5, None), ylim=(0, 90))
    axes[1].set_title(f"{cases[0].profile}, frames in contact", fontsize=10)
    axes[1].legend(fontsize=8, markerscale=4)
    for axis in axes:
        axis.grid(alpha=0.25)
