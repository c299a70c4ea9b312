"""Lin 2013's renormalisation (IV.B) against the board's tare machine: slow loads, lock-out and drift.

The emulated finger's rest is known: the truth is the sensor model's rest at each row's temperature, with drift, never
computed from counts. The retained share of a load is |e| above a tare over |e| above the true rest; an error of the
tare is |tare - true rest|. The paper's threshold is 32 counts of either.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from biotac import FrameFlags
from biotac.core import geometry as surface
from biotac.sim import FLAT_MM, PROFILES, Pose, Profile, SimFinger

from ..report import Options, Report, Table, check, claim
from .lin_tare import READINGS, THRESHOLD_COUNT2, renormalised
from .trial import Bools, Floats, Script, Trial, play

PEAK_N, RATES_N_S, HOLD_S = 3.0, (0.3, 0.5, 1.0, 2.0, 5.0, 10.0, 30.0), 2.0
PRESS_N, PRESS_S, AFTER_S = 10.0, 20.0, 120.0
COLD_C, HOT_C, WARMING_S = 30.0, 32.0, 300.0
REST_S = 4.0
BOARD = "the board's machine"
WAYS = (*(f"Lin, {reading}" for reading in READINGS), BOARD)
DRAWN_N_S = 1.0
KEPT_ASKED, ERROR_ASKED_COUNTS = 0.9, 10.0
COLORS = ("#c2410c", "#d6a77a", "#a8a29e", "#1d4ed8")


def at_rest(trial: Trial, seed: int, profile: Profile) -> Floats:
    """The emulated finger's untouched reading (n, 19), at each row's temperature and after drift."""
    assert trial.states is not None
    finger = SimFinger(seed, profile)
    return finger.rest_counts(trial.states.warm_c) + np.outer(trial.time_s / 60.0, finger.drift_per_min)


def tares(trial: Trial) -> dict[str, tuple[Floats, Bools]]:
    """Of each of WAYS the tare (n, 19), and the rows that gave a new one."""
    found = {f"Lin, {reading}": renormalised(trial.counts, reading) for reading in READINGS}
    return found | {BOARD: (trial.tare, np.asarray(trial.rows["flags"] & FrameFlags.TARE_CHANGED != 0))}


def slow_load(seed: int, profile: Profile, rate_n_s: float) -> Trial:
    """A flat that presses E17 at this rate, holds for HOLD_S, and lets go."""
    x_mm, y_mm, _ = surface.project(surface.ELECTRODE_MM[[16]])[0].tolist()
    script, rest = Script(), Pose(x_mm, y_mm, tip_mm=FLAT_MM)
    script.phase("rest", 0.1, REST_S, rest, rest)
    script.phase("hold", PEAK_N / rate_n_s, HOLD_S, Pose(x_mm, y_mm, PEAK_N, tip_mm=FLAT_MM))
    script.phase("release", 0.2, 1.0, rest)
    return play("slow load", script, seed=seed, profile=profile)


def long_press(seed: int, profile: Profile) -> Trial:
    """A press of something warm, and the rest after it: the reading at rest is no longer the one before."""
    x_mm, y_mm, _ = surface.project(surface.ELECTRODE_MM[[16]])[0].tolist()
    script = Script()
    rest, warm = (Pose(x_mm, y_mm, tip_mm=FLAT_MM, celsius=celsius) for celsius in (COLD_C, HOT_C))
    script.phase("rest", 0.1, REST_S, rest, rest)
    script.phase("press", 0.3, 1.0, Pose(x_mm, y_mm, PRESS_N, tip_mm=FLAT_MM, celsius=COLD_C))
    script.phase("warming", PRESS_S, 1.0, Pose(x_mm, y_mm, PRESS_N, tip_mm=FLAT_MM, celsius=HOT_C))
    script.phase("after", 0.2, AFTER_S, warm)
    return play("long press", script, seed=seed, profile=profile)


def drift(seed: int, profile: Profile) -> Trial:
    """A finger that nothing touches, warming up."""
    script, rest = Script(), Pose(0.0, 0.0, celsius=COLD_C)
    script.phase("rest", 0.1, REST_S, rest, rest)
    script.phase("warming", WARMING_S, 1.0, Pose(0.0, 0.0, celsius=HOT_C))
    return play("drift", script, seed=seed, profile=profile)


def size(values: Floats) -> Floats:
    """Length (n,) over the electrodes."""
    result: Floats = np.linalg.norm(values, axis=1)
    return result


def run(options: Options) -> Report:
    """Three tables, new and worn: slow loads, after a long press, drift."""
    kept: dict[str, list[list[Any]]] = {way: [] for way in WAYS}
    locked: list[list[Any]] = []
    drawn: list[tuple[str, Trial, Floats]] = []
    hysteresis: list[list[Any]] = []
    for profile in PROFILES:
        options.show(f"slow loads on the {profile} sensor")
        held: dict[str, list[Any]] = {way: [profile, way] for way in WAYS}
        for rate in RATES_N_S:
            trial = slow_load(options.seed, profile, rate)
            rest, rows = at_rest(trial, options.seed, profile), trial.during(trial.phases[1])
            for way, (tare, _) in tares(trial).items():
                held[way].append(float(np.mean(size(trial.counts - tare)[rows] / size(trial.counts - rest)[rows])))
            if rate == DRAWN_N_S:
                last, full = trial.time_s > trial.phases[-1].end_s - 0.3, (trial.counts - rest)[rows].mean(axis=0)
                ends = [(trial.counts - base)[last].mean(axis=0) for base in (rest, trial.tare)]
                hysteresis.append([profile, *[100.0 * np.linalg.norm(e) / np.linalg.norm(full) for e in ends]])
            if rate == DRAWN_N_S and profile == PROFILES[0]:
                drawn.append((f"{rate:g} N/s to {PEAK_N:g} N", trial, rest))
        for way in WAYS:
            kept[way].append(held[way])
        pressed, warmed = long_press(options.seed, profile), drift(options.seed, profile)
        if profile == PROFILES[0]:
            drawn.append((f"{PRESS_N:g} N of something warm", pressed,
                          at_rest(pressed, options.seed, profile)))  # fmt: skip
        ended, begun = pressed.phases[-1].begin_s, warmed.phases[-1].begin_s - WARMING_S
        for way in WAYS:
            (tare, is_new), (follows, _) = tares(pressed)[way], tares(warmed)[way]
            off, after = size(tare - at_rest(pressed, options.seed, profile)), pressed.time_s > ended
            near = np.flatnonzero(off[after] < ERROR_ASKED_COUNTS)
            away = size(follows - at_rest(warmed, options.seed, profile))[warmed.time_s > begun].max()
            left = float(off[pressed.time_s > pressed.phases[-1].end_s - 1.0].max())
            found = left, int(is_new[after].sum()), near[0] / 100 if len(near) else None, float(away)
            locked.append([profile, way, *found])
    head = ["sensor", "tare by", *[f"{rate:g} N/s" for rate in RATES_N_S]]
    slow_rows = [row for way in WAYS for row in kept[way]]
    pressed_as = f"A flat on E17 pressed to {PEAK_N:g} N at this rate, mean over {HOLD_S:g} s of holding it."
    first = Table("Slow loads: share of the signal that is kept", head, slow_rows, pressed_as)
    second = Table(
        "Lock-out and drift: error of the tare",
        ["sensor", "tare by", "after the press [counts]", "new tares", f"within {ERROR_ASKED_COUNTS:g} after [s]",
         "warming untouched [counts]"],
        locked,
        f"|tare - rest|, {AFTER_S:g} s after {PRESS_N:g} N of something {HOT_C - COLD_C:g} degrees warmer for "
        f"{PRESS_S:g} s, largest in a second; and the largest while the finger warms by as much untouched in "
        f"{WARMING_S / 60:g} min. The paper's threshold is {THRESHOLD_COUNT2**0.5:.1f} counts; noise alone is "
        "7 (new) or 22 (worn).",
        digits=2,
    )  # fmt: skip
    lin, sliding, change, own = (np.array([row[2:] for row in kept[way]]) for way in WAYS)
    from_half, slow, fast = RATES_N_S.index(0.5), RATES_N_S.index(5.0), RATES_N_S.index(10.0)
    checks = [
        check("board: share of a slow load's signal that is lost, worst", 1 - own.min(), 1 - KEPT_ASKED, ""),
        check("board: error of the tare after the press, worst", max(row[2] for row in locked if row[1] == BOARD),
              ERROR_ASKED_COUNTS, "counts"),
        check("board: error of the tare while warming, worst", max(row[5] for row in locked if row[1] == BOARD),
              ERROR_ASKED_COUNTS, "counts"),
        claim("Lin, side by side: locked out after the press, no new tare",
              all(row[3] == 0 and row[2] ** 2 > THRESHOLD_COUNT2 for row in locked if row[1] == WAYS[0])),
        claim("Lin, side by side: loads from 0.5 N/s on are kept, slower ones zeroed",
              bool((lin[:, from_half:] > KEPT_ASKED).all() and (lin[:, :from_half] < 0.5).all())),
        claim("Lin, in every row: loads slower than 5 N/s are zeroed, from 10 N/s on kept, on the new sensor",
              bool((sliding[0, :slow] < 0.5).all() and (sliding[0, fast:] > KEPT_ASKED).all())),
        claim("Lin, within the window: every held load is zeroed", bool((change < 0.5).all())),
    ]  # fmt: skip
    notes = [
        "true rest: the sensor model's, at each row's temperature, with its drift",
        "the board waits while pressure says that something may still be held (DOUBT), and then takes the residue",
    ]
    third = Table(
        "Hysteresis",
        ["sensor", "left [%]", "by the board [%]"],
        hysteresis,
        f"Of the signal of {PEAK_N:g} N, the mean of what is left in the last .3 s of the second after it.",
    )
    return Report(options.source, [first, second, third], checks, notes, lambda figure: _draw(drawn, figure))


def _draw(drawn: list[tuple[str, Trial, Floats]], figure: Any) -> None:
    """The signal's length above each tare and above the true rest."""
    figure.set_size_inches(13, 5)
    for axes, (title, trial, rest) in zip(figure.subplots(1, len(drawn)), drawn, strict=True):
        axes.plot(trial.time_s, size(trial.counts - rest), color="#111111", linewidth=2.5, label="above the true rest")
        for (way, (tare, _)), color in zip(tares(trial).items(), COLORS, strict=True):
            axes.plot(trial.time_s, size(trial.counts - tare), color=color, linewidth=1, label=way)
        axes.set(title=title, xlabel="s", ylabel="|e| [counts]", yscale="log")
        axes.legend(fontsize=8)
        axes.grid(alpha=0.25)
