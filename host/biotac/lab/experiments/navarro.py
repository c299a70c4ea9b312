"""Pressure calibration of five fingers and its verification press: Navarro et al. 2015.

Each finger presses a force plate three times, harder each time; K is fitted to the held rows and written to the board.
Then each presses once more, and the board's force is compared with the plate's. Here hand and plate are emulated; all
other numbers are the board's own, set, read back and streamed over its link.

The paper's Pa are counts (protocol/SPEC.md). Its P0 of 57 to 106 are from sensors with an unknown zero. K and P0 differ
from hand to hand, so only the verification press's relative error can be compared.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...calibrate.press.detector import Press, Procedure
from ...calibrate.press.force_source import Truth
from ...calibrate.press.guide import Unattended, guide
from ...calibrate.press.pressure import (
    CALIBRATION_FORCES_N,
    PAPER_ERROR,
    VERIFICATION_FORCES_N,
    Fit,
    Verification,
    fit,
    relative_error,
    verify,
    with_board_force,
)
from ...calibrate.press.pressure_procedure import put, with_gain
from ...calibrate.press.rows import rows_of
from ...hand.hand import Hand
from ...hand.opening import shake_hands
from ...markdown import table
from ...recording.crosscheck import CrossCheck
from ...sim.physics import Profile
from ...sim.play import play
from ...sim.ports import start_board
from ...sim.process import SimLink
from ...sim.scenario import parse_scenario
from ...sim.source import Source
from .outcome import Facts, Options, Show, check, claim, number, numbers, text

RECORDING = ""
MAPS = False

NAMES = ("thumb", "fore", "middle", "ring", "little")
PAPER_GAIN_N = (0.016, 0.010, 0.013, 0.009, 0.009)  # Table I
PAPER_REST_COUNTS = (85.0, 86.0, 106.0, 57.0, 70.0)
FINGERS = tuple(range(len(NAMES)))
PLACE = "E17"
PLACES = ("E7", "E10", "E17", "E18", "E16")  # from the tip backwards
RAMP_S, HOLD_S, REST_S = 0.4, 1.4, 1.5
PRESS_S = 2 * RAMP_S + HOLD_S + REST_S


@dataclass(frozen=True)
class Calibrated:
    """One emulated finger: the fit of its presses, and what its verification press showed."""

    seed: int
    fit: Fit
    presses: list[Press]
    verification: Press
    verified: Verification


@dataclass(frozen=True)
class Hands:
    """One emulated hand, calibrated and verified."""

    profile: Profile
    fingers: tuple[Calibrated, ...]
    frames_checked: int
    violations: int


@dataclass(frozen=True)
class Result:
    """Hands of each profile, and the effect of where a press is, see places()."""

    hands: tuple[Hands, ...]
    places: Facts


def run(options: Options) -> Result:
    """Calibrate five fingers of each profile: new with seeds from ``options.seed`` on, worn with the next ones."""
    new = calibrate(options.seed, "new", options.show)
    worn = calibrate(options.seed + len(FINGERS), "worn", options.show)
    return Result((new, worn), places(options.seed))


def calibrate(
    seed: int,
    profile: Profile = "new",
    show: Show = lambda words: None,
    *,
    board: str = "posix",
    fingers: Sequence[int] = FINGERS,
) -> Hands:
    """Calibrate and verify an emulated hand, all five fingers or some, on an emulated ``board`` (posix or pico).

    The source is played twice, because a board takes no calibration while it streams, and emulated time does not wait
    for commands. The second time K is in force from the start, and only the last press of each finger is used.
    """
    seeds = tuple(seed + k for k in range(len(fingers)))
    forces = CALIBRATION_FORCES_N, VERIFICATION_FORCES_N
    series = [presses(fingers, its, [PLACE] * len(its)) for its in forces]
    source = emulated_hand("navarro", seeds, profile, [*series[0], *series[1]])
    # The first series' length. The second begins later by the initial rest, which its first press needs as its rest.
    verify_s = len(fingers) * len(CALIBRATION_FORCES_N) * PRESS_S

    first = Procedure(fingers, CALIBRATION_FORCES_N)
    show(f"{profile}: three presses per finger")
    with _open(source, board) as hand:
        guide(hand, first, Truth(source), Unattended())
    fits = {f: fit(first.rests[f], presses) for f, presses in first.presses.items()}

    second = Procedure(fingers, VERIFICATION_FORCES_N)
    outcome, truth = CrossCheck(), Truth(source)
    show(f"{profile}: one verification press per finger")
    with _open(source, board) as hand:
        for its in fits.values():
            put(hand, its.finger, with_gain(hand, its, int(time.time())))
        settings, own = hand.settings(), hand.finger_settings()
        for batch in hand.batches():
            outcome.add(batch.wire, settings, own)
            rows = rows_of(batch.wire, batch.t_us, truth)
            second.feed(rows[rows["t_us"] - truth.first_us >= verify_s * 1e6])
    second.finish()
    calibrated = []
    for its_seed, finger in zip(seeds, fingers, strict=True):
        press = second.presses[finger][0]
        verified = verify(fits[finger], press)
        calibrated.append(Calibrated(its_seed, fits[finger], first.presses[finger], press, verified))
    return Hands(profile, tuple(calibrated), outcome.frames, outcome.violations)


def places(seed: int) -> Facts:
    """One finger calibrated at each of PLACES, by the board's own code.

    ``gain_n`` is in mN per count; ``errors`` in %: K from the row's place, applied at the column's.
    """
    each = len(CALIBRATION_FORCES_N)
    forces = CALIBRATION_FORCES_N * len(PLACES)
    source = emulated_hand("places", [seed], "new", presses([0], forces, np.repeat(PLACES, each).tolist()))
    procedure = Procedure([0], forces)
    with _open(source, "posix") as hand:
        guide(hand, procedure, Truth(source), Unattended())
    groups = [procedure.presses[0][k : k + each] for k in range(0, len(forces), each)]
    fits = [fit(procedure.rests[0], group) for group in groups]
    assert source.truth is not None
    frames = [round(float(group[0].rows["t_us"].mean()) * 1e-6 * 100) for group in groups]
    return {
        "names": list(PLACES),
        "x_mm": numbers(source.truth.poc_mm[frames, 0, 0]),
        "gain_n": numbers([its.gain_n * 1e3 for its in fits]),
        "errors": [numbers([_error_percent(its.gain_nn, group) for group in groups]) for its in fits],
    }


def _error_percent(gain_nn: int, group: Sequence[Press]) -> float:
    rows = np.concatenate([with_board_force(press, gain_nn).rows for press in group])
    return 100 * relative_error(rows["board_n"], rows["force_n"])


def _open(source: Source, board: str) -> Hand:
    return shake_hands(SimLink(f"{board}:{source.name}", start_board(board, source, pace=0.0)))


# ---- what the emulated hand does ----------------------------------------------------------------


def presses(fingers: Sequence[int], forces_n: Sequence[float], at: Sequence[str]) -> list[str]:
    """Scenario steps: each of ``fingers`` presses with each force, at the electrode of the same index in ``at``."""
    return [
        _step(finger, do, for_s, more)
        for finger in fingers
        for force_n, place in zip(forces_n, at, strict=True)
        for do, for_s, more in (
            ("press", RAMP_S, f'at = "{place}"\nforce_n = {force_n:g}\n'),
            ("hold", HOLD_S, ""),
            ("press", RAMP_S, "force_n = 0.0\n"),
            ("rest", REST_S, ""),
        )
    ]


def _step(finger: int, do: str, for_s: float, more: str) -> str:
    return f'[[step]]\ndo = "{do}"\nfingers = [{finger}]\nseconds = {for_s:g}\n{more}'


def scenario(name: str, seeds: Sequence[int], profile: Profile, steps: Sequence[str]) -> str:
    """The text of a scenario: a finger for each seed, starting at rest."""
    sensors = [f'[[finger]]\nseed = {seed}\nprofile = "{profile}"\n' for seed in seeds]
    return "\n".join([f'name = "{name}"\n', *sensors, f'[[step]]\ndo = "rest"\nseconds = {REST_S:g}\n', *steps])


def emulated_hand(name: str, seeds: Sequence[int], profile: Profile, steps: Sequence[str]) -> Source:
    """That scenario, played."""
    return play(parse_scenario(scenario(name, seeds, profile, steps).encode(), file=f"{name}.toml"))


# ---- words and pictures ------------------------------------------------------------------------------------


def facts(result: Result) -> Facts:
    """All figures, as JSON types."""
    hands, checks = [], []
    for its in result.hands:
        hands.append(
            {
                "profile": its.profile,
                "fingers": [{"name": name} | _finger(one) for name, one in zip(NAMES, its.fingers, strict=True)],
                "frames_checked": its.frames_checked,
                "violations": its.violations,
            }
        )
        worst = max(one.verified.board_error for one in its.fingers)
        what = f"relative error of the verification press, worst of five fingers, {its.profile}, computed on board"
        checks.append(check(what, worst * 100, 5.9, "%"))
        right = its.violations == 0 and its.frames_checked > 0
        checks.append(claim(f"board and float64 agree in all {its.frames_checked} frames, {its.profile}", right))
    seeds = [one.seed for its in result.hands for one in its.fingers]
    return {
        "experiment": "navarro",
        "source": f"emulated hands of five fingers, seeds {seeds[0]} to {seeds[-1]}",
        "hands": hands,
        "paper": {
            "gain_n": [gain * 1e3 for gain in PAPER_GAIN_N],
            "rest_counts": list(PAPER_REST_COUNTS),
            "error": PAPER_ERROR * 100,
        },
        "places": result.places,
        "checks": checks,
        "notes": [
            f"presses of {', '.join(f'{f:g}' for f in CALIBRATION_FORCES_N)} N, then "
            f"{VERIFICATION_FORCES_N[0]:g} N, with a 7 mm flat at {PLACE}; the force is the scenario's, without error",
            "pressure follows the same law in every emulated finger, with a factor that depends on the place along "
            "the finger; real fingers differ more in K",
            "a worn emulated sensor differs only in its electrodes: for pressure, these are just five more fingers",
            "relative error: |estimate - F| / |F|, Euclidean norms over the held rows; the paper gives no formula",
            "P0 is each frame's tare; the table has the mean at rest before the first press",
            "tare off: the largest difference between a held row's tare and that mean; a tare taken right after a "
            "release still contains some residue of the press",
        ],
    }


def _finger(its: Calibrated) -> Facts:
    rest_off = max(np.abs(press.rows["rest"] - its.fit.rest.counts).max() for press in its.presses)
    return {
        "seed": its.seed,
        "gain_n": number(its.fit.gain_n * 1e3),
        "rest_counts": number(its.fit.rest.counts),
        "rest_off_counts": number(rest_off),
        "fit_error": number(its.fit.relative_error * 100),
        "board_error": number(its.verified.board_error * 100),
        "float_error": number(its.verified.float_error * 100),
        "apart_mn": number(its.verified.apart_n * 1e3),
    }


def page(facts: Facts) -> list[str]:
    """The table of K and P0, the errors, and the effect of another place."""
    lines = []
    for its in facts["hands"]:
        rows = [
            [
                one["name"],
                f"{text(one['gain_n'])} ({text(gain, 0)})",
                f"{text(one['rest_counts'], 1)} ({text(rest, 0)})",
                text(one["rest_off_counts"], 1),
                *[text(one[key], 2) for key in ("fit_error", "board_error", "float_error")],
                text(one["apart_mn"]),
            ]
            for one, gain, rest in zip(
                its["fingers"], facts["paper"]["gain_n"], facts["paper"]["rest_counts"], strict=True
            )
        ]
        head = ["finger", "K (paper) [mN/count]", "P0 (paper) [count]", "tare off [count]", "fit [%]",
                "verified, board [%]", "verified, float64 [%]", "apart [mN]"]  # fmt: skip
        lines += [f"## Five fingers, {its['profile']}", "", *table(head, rows)]
    where = facts["places"]
    rows = [
        [f"{name} ({text(x, 1)} mm)", text(gain), *[text(one, 2) for one in errors]]
        for name, x, gain, errors in zip(where["names"], where["x_mm"], where["gain_n"], where["errors"], strict=True)
    ]
    lines += [
        f"The paper's verification press, fore finger: {facts['paper']['error']:.2f} %.",
        "",
        "## Place of the press",
        "",
        "K fitted at one place (row), and its relative error in % at each place (column). K is valid only where it was "
        "fitted.",
        "",
        *table(["K from (x)", "K [mN/count]", *where["names"]], rows),
    ]
    return lines


def draw(result: Result, figure: Any) -> None:
    """Figure 3 for each finger: pressure above rest against force, the held rows and the line of slope K."""
    figure.set_size_inches(15, 3.4 * len(result.hands))
    axes = figure.subplots(len(result.hands), len(NAMES), squeeze=False)
    for its, row in zip(result.hands, axes, strict=True):
        for name, one, ax in zip(NAMES, its.fingers, row, strict=True):
            held, extra = np.concatenate([press.rows for press in one.presses]), one.verification.rows
            for rows, color, label in ((held, "#1d4ed8", "calibration"), (extra, "#c2410c", "verification")):
                ax.plot(rows["pressure"] - rows["rest"], rows["force_n"], ".", color=color, markersize=3, label=label)
            top = float((held["pressure"] - held["rest"]).max())
            ax.plot([0, top], [0, top * one.fit.gain_n], color="#111111", linewidth=1, label="slope K")
            error = one.verified.board_error
            ax.set_title(f"{name}, {its.profile}: {one.fit.gain_n * 1e3:.2f} mN/count, {error:.2%}", fontsize=9)
            ax.set(xlabel="P - P0 [count]", ylabel="F [N]")
            ax.grid(alpha=0.25)
    axes[0][0].legend(fontsize=8)
