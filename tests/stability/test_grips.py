"""A restart in a grip, pressure that does not move, a hot cup: is the force right, or flagged?

The sensor model, new and worn, anywhere on the skin. The error is the tare's, through Lin's gains, scaled so that the
load itself has its true size: what a calibrated finger would be wrong by.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, replace

import numpy as np
import wrong_by
from courses import Course, Script, Sensor, script

from biotac import Finger, FrameFlags
from biotac.core import geometry
from biotac.core.geometry import Floats
from biotac.sim.timeline import Pose
from biotac.wire.frames import StructArray

NIGHTLY = bool(os.environ.get("BIOTAC_NIGHTLY"))
GRIPS = 300 if NIGHTLY else 60
WRONG_N, WRONG_SHARE = 0.5, 0.25
WARNINGS = FrameFlags.UNTARED | FrameFlags.FAULT | FrameFlags.DOUBT | FrameFlags.TEMP | FrameFlags.TARE_UNSURE


def anywhere(rng: np.random.Generator) -> Pose:
    """Over an electrode, or anywhere on the ventral skin."""
    if rng.random() < 0.5:
        x_mm, y_mm, z_mm = geometry.ELECTRODE_MM[rng.integers(19)]
        if z_mm < 0:
            return Pose(x_mm=x_mm, y_mm=y_mm, tip_mm=rng.uniform(1, 4))
    return Pose(x_mm=rng.uniform(-14, 4), y_mm=rng.uniform(-4, 4), tip_mm=rng.uniform(1, 4))


def begun(rng: np.random.Generator) -> Script:
    """A sensor and a place."""
    made = Script(Sensor(int(rng.integers(1 << 30)), "worn" if rng.random() < 0.5 else "new"))
    made.track.pose = anywhere(rng)
    return made


def row(script: Script) -> int:
    """The one that comes next."""
    return round(100 * script.track.seconds)


def n_per_count(sensor: Sensor) -> float:
    """Lin's gain, alike for all axes, that makes 2 N over E17 read 2 N."""
    pressed = script(sensor.seed, sensor.profile, 1).load(2, 10).make()
    return float(2.0 / np.linalg.norm(pressed.signal[-1] @ geometry.ELECTRODE_NORMAL))


def forces_n(course: Course, rows: StructArray, first: int = 0) -> tuple[Floats, Floats]:
    """What each row's force is wrong by because of its tare, and its true size, both (n,) in N.

    Truth is what skin that creeps reads without the load. ``first`` is the course's row at which ``rows`` begin.
    """
    part = slice(first, first + len(rows))
    gain = n_per_count(course.sensor)
    tare_off = course.reads[part] - course.signal[part] - rows["tare_q4"] / 16.0
    off, true = (e @ geometry.ELECTRODE_NORMAL for e in (tare_off, course.signal[part]))
    return gain * np.linalg.norm(off, axis=1), gain * np.linalg.norm(true, axis=1)


def mean_of(values: Floats, rows: int = 8) -> Floats:
    return np.convolve(values, np.ones(rows) / rows, "same")


@dataclass(frozen=True)
class Grip:
    """A grip that the board's start interrupts, and the rows of the three grasps after it."""

    course: Course
    start: int
    grasps: list[slice]

    def rows(self) -> StructArray:
        """The board's, from its start on."""
        return Finger().feed(**{name: words[self.start :] for name, words in self.course.words.items()})


def grip(seed: int, lead_s: float = 1.0) -> Grip:
    rng = np.random.default_rng([29, seed])
    script = begun(rng).rest(lead_s)
    held_n = rng.uniform(0.5, 5)
    script.load(held_n, rng.uniform(3, 30)).hold(rng.uniform(1, 20))
    start = row(script)
    script.hold(rng.uniform(0.5, 5))
    for _ in range(rng.integers(3)):  # tighter or looser, before it opens
        script.load(held_n * rng.uniform(0.4, 2.5), rng.uniform(2, 20)).hold(rng.uniform(0.2, 3))
    script.load(0, rng.uniform(3, 30)).rest(rng.uniform(1, 8))
    grasps = []
    for _ in range(3):
        at = script.track.pose.released() if rng.random() < 0.5 else anywhere(rng)
        script.load(rng.uniform(0.5, 6), rng.uniform(3, 20), at)
        first = row(script)
        script.hold(rng.uniform(1, 4))
        grasps.append(slice(first + 5, row(script)))
        script.load(0, rng.uniform(3, 30)).rest(rng.uniform(1, 8))
    return Grip(script.make(), start, grasps)


def grasped(case: Grip) -> list[tuple[bool, bool, bool]]:
    """Of each grasp: wrong anywhere, wrong and unflagged, unsure."""
    rows = case.rows()
    off_n, true_n = forces_n(case.course, rows, case.start)
    wrong = off_n > np.maximum(WRONG_N, WRONG_SHARE * true_n)
    found = []
    for part in case.grasps:
        here = slice(part.start - case.start, part.stop - case.start)
        flags = rows["flags"][here]
        silent = wrong[here] & ((flags & WARNINGS) == 0)
        found.append((bool(wrong[here].any()), bool(silent.any()), bool((flags & FrameFlags.TARE_UNSURE).any())))
    return found


def test_without_a_restart_a_grasp_is_right() -> None:
    most_n = 0.0
    for seed in range(60):
        case = replace(grip(seed, lead_s=10), start=0)
        off_n, _ = forces_n(case.course, case.rows())
        most_n = max(most_n, *(off_n[part].max() for part in case.grasps))
    wrong_by.row(
        "drift in a hold, what presses leave in the skin, noise of a worn finger", most_n, "none", "keeps that margin"
    )
