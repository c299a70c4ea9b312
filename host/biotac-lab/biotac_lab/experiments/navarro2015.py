"""Pressure calibration of five fingers and a verification press: Navarro et al. 2015.

Each finger presses a force plate three times, harder each time; K is fitted to the held rows and written to the board.
Then each presses once more, and the board's force is compared with the plate's. Here hand and plate are emulated; all
other numbers are the board's own, set, read back and streamed over the link.

The paper's Pa are counts (protocol/SPEC.md). The P0 of 57 to 106 are from sensors with an unknown zero. K and P0 differ
from hand to hand, so only the verification press's relative error can be compared.
"""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import biotac
from biotac.calibrate.press import (
    CALIBRATION_FORCES_N,
    PAPER_ERROR,
    VERIFICATION_FORCES_N,
    Press,
    PressureFit,
    Procedure,
    Verification,
    fit,
    guide,
    put,
    relative_error,
    rows_of,
    truth_of,
    verify,
    with_board_force,
    with_gain,
)
from biotac.recording import CrossCheck
from biotac.sim import PROFILES, Profile

from ..report import Options, Report, Show, Table, check, claim
from . import navarro_active

NAMES = ("thumb", "fore", "middle", "ring", "little")
PAPER_GAIN_N = (0.016, 0.010, 0.013, 0.009, 0.009)  # Table I
PAPER_REST_COUNTS = (85.0, 86.0, 106.0, 57.0, 70.0)
LIMIT_PERCENT = 5.9
FINGERS = tuple(range(len(NAMES)))
PLACE = "E17"
PLACES = ("E7", "E10", "E17", "E18", "E16")  # from the tip backwards
RAMP_S, HOLD_S, REST_S = 0.4, 1.4, 1.5
PRESS_S = 2 * RAMP_S + HOLD_S + REST_S


@dataclass(frozen=True)
class Calibrated:
    """One emulated finger: the fit of the presses, and the outcome of the verification press."""

    seed: int
    fit: PressureFit
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


def calibrate(
    seed: int,
    profile: Profile = "new",
    show: Show = lambda text: None,
    *,
    board: str = "sim",
    fingers: Sequence[int] = FINGERS,
) -> Hands:
    """Calibrate and verify an emulated hand, all five fingers or some, on an emulated ``board`` (sim or pico).

    The source is played twice, because a board accepts no calibration while it streams, and emulated time does not
    wait for commands. The second time K is in force from the start, and only the last press of each finger is used.
    """
    seeds = tuple(seed + k for k in range(len(fingers)))
    forces = CALIBRATION_FORCES_N, VERIFICATION_FORCES_N
    series = [presses(fingers, forces_n, [PLACE] * len(forces_n)) for forces_n in forces]
    text = scenario("navarro", seeds, profile, [*series[0], *series[1]])
    # The first series' length. The second begins later by the initial rest, which the first press there needs as rest.
    verify_s = len(fingers) * len(CALIBRATION_FORCES_N) * PRESS_S

    first = Procedure(fingers, CALIBRATION_FORCES_N)
    show(f"{profile}: three presses per finger")
    with _played(text, board) as (hand, truth):
        guide(hand, first, truth, None)
    fits = {f: fit(first.rests[f], presses) for f, presses in first.presses.items()}

    second = Procedure(fingers, VERIFICATION_FORCES_N)
    outcome = CrossCheck()
    show(f"{profile}: one verification press per finger")
    with _played(text, board) as (hand, truth):
        for fitted in fits.values():
            put(hand, fitted.finger, with_gain(hand, fitted, int(time.time())))
        settings, own, begin_us = hand.board.settings(), hand.board.finger_settings(), None
        for batch in hand.batches():
            outcome.add(batch.wire, settings, own)
            rows = rows_of(batch.wire, batch.t_us, truth)
            begin_us = batch.first_t_us() if begin_us is None else begin_us
            second.feed(rows[rows["t_us"] - (begin_us or 0) >= verify_s * 1e6])
    second.finish()
    calibrated = []
    for own_seed, finger in zip(seeds, fingers, strict=True):
        press = second.presses[finger][0]
        verified = verify(fits[finger], press)
        calibrated.append(Calibrated(own_seed, fits[finger], first.presses[finger], press, verified))
    return Hands(profile, tuple(calibrated), outcome.frames, outcome.violations)


def places(seed: int) -> Table:
    """One finger calibrated at each of PLACES, by the board's own code: K from the row's, applied at the column's."""
    each = len(CALIBRATION_FORCES_N)
    forces = CALIBRATION_FORCES_N * len(PLACES)
    text = scenario("places", [seed], "new", presses([0], forces, np.repeat(PLACES, each).tolist()))
    procedure = Procedure([0], forces)
    with _played(text, "sim") as (hand, truth):
        guide(hand, procedure, truth, None)
    groups = [procedure.presses[0][k : k + each] for k in range(0, len(forces), each)]
    fits = [fit(procedure.rests[0], group) for group in groups]
    rows = [
        [name, fitted.gain_n * 1e3, *[_error_percent(fitted.gain_nn, group) for group in groups]]
        for name, fitted in zip(PLACES, fits, strict=True)
    ]
    caption = (
        "K fitted at one place (row), and its relative error in % at each place (column), from the tip backwards. K is "
        "valid only where it was fitted."
    )
    return Table("Place of the press", ["K from", "K [mN/count]", *PLACES], rows, caption)


def _error_percent(gain_nn: int, group: Sequence[Press]) -> float:
    rows = np.concatenate([with_board_force(press, gain_nn).rows for press in group])
    return 100 * relative_error(rows["board_n"], rows["force_n"])


@contextlib.contextmanager
def _played(text: str, board: str) -> Iterator[tuple[biotac.Hand, Any]]:
    """A board that plays a scenario, and the force in it."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "navarro.toml")
        path.write_text(text, encoding="utf-8")
        with biotac.open(f"sim:{path}" if board == "sim" else f"emu:{board}?source={path}") as hand:
            yield hand, truth_of(hand)


# ---- the emulated hand's motion -----------------------------------------------------------------


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


# ---- the report ---------------------------------------------------------------------------------


def run(options: Options, hands: Sequence[Hands] = ()) -> Report:
    """Calibrate five fingers of each profile: new with seeds from ``options.seed`` on, worn with the next ones."""
    hands = hands or [calibrate(options.seed + k * len(FINGERS), name, options.show) for k, name in enumerate(PROFILES)]
    seeds = [finger.seed for hand in hands for finger in hand.fingers]
    checks = []
    for hand in hands:
        worst = max(finger.verified.board_error for finger in hand.fingers)
        text = f"relative error of the verification press, worst of five fingers, {hand.profile}, computed on board"
        right = hand.violations == 0 and hand.frames_checked > 0
        checks += [
            check(text, worst * 100, LIMIT_PERCENT, "%"),
            claim(f"board and float64 agree in all {hand.frames_checked} frames, {hand.profile}", right),
        ]
    options.show("hands of two and of five fingers that press by themselves")
    active: dict[tuple[tuple[str, ...], str], list[navarro_active.Active]] = {
        (names, how): navarro_active.calibrate(options.seed, names, newtons=how == "newtons")
        for names, how in ((NAMES[:2], "joint angles"), (NAMES, "newtons"))
    }
    checks += [
        check(f"relative error of the verifying touch, worst of {len(names)} fingers that were driven by {how}",
              max(finger.verified.board_error for finger in found) * 100, LIMIT_PERCENT, "%")
        for (names, how), found in active.items()
    ]  # fmt: skip
    notes = [
        f"presses of {', '.join(f'{f:g}' for f in CALIBRATION_FORCES_N)} N, then "
        f"{VERIFICATION_FORCES_N[0]:g} N, with a 7 mm flat at {PLACE}; the force is the scenario's, without error",
        "pressure follows the same law in every emulated finger, with a factor that depends on the place along "
        "the finger; real fingers differ more in K",
        "a worn emulated sensor differs only in its electrodes: for pressure, these are just five more fingers",
        "relative error: |estimate - F| / |F|, Euclidean norms over the held rows; the paper gives no formula",
        "P0 is each frame's tare; the table has the mean at rest before the first press",
        "tare off: the largest difference between a held row's tare and that mean; a tare taken right after a "
        "release still contains some residue of the press",
    ]
    tables = [*[_fingers(hand) for hand in hands], _active(active), places(options.seed)]
    source = f"emulated hands of five fingers, seeds {seeds[0]} to {seeds[-1]}"
    return Report(source, tables, checks, notes, lambda figure: _draw(hands, figure))


def _active(found: dict[tuple[tuple[str, ...], str], list[navarro_active.Active]]) -> Table:
    rows = [
        [f"{len(names)}, by {how}", own.finger, own.fit.gain_n * 1e3, *own.fit.press_forces_n,
         own.fit.relative_error * 100, own.verified.force_n, own.verified.board_error * 100]
        for (names, how), active in found.items() for own in active
    ]  # fmt: skip
    head = ["hand of fingers", "finger", "K [mN/count]", "touch 1 [N]", "2", "3", "fit [%]", "touch 4 [N]",
            "verified, board [%]"]  # fmt: skip
    text = (
        "The procedure drives the hand finger by finger, by joint angles (18, 20, 22 and 21 degrees) or newtons; K is "
        "on the board before the fourth touch."
    )
    return Table("Active calibration", head, rows, text)


def _fingers(hand: Hands) -> Table:
    """The table of K and P0, and the errors."""
    rows = []
    for k, finger in enumerate(hand.fingers):
        rest_off = max(np.abs(press.rows["rest"] - finger.fit.rest.counts).max() for press in finger.presses)
        verified = finger.verified
        errors = [finger.fit.relative_error * 100, verified.board_error * 100, verified.float_error * 100]
        rows.append([
            NAMES[k], finger.fit.gain_n * 1e3, PAPER_GAIN_N[k] * 1e3, finger.fit.rest.counts, PAPER_REST_COUNTS[k],
            float(rest_off), *errors, verified.apart_n * 1e3,
        ])  # fmt: skip
    head = ["finger", "K [mN/count]", "paper's K", "P0 [count]", "paper's P0", "tare off [count]", "fit [%]",
            "verified, board [%]", "verified, float64 [%]", "apart [mN]"]  # fmt: skip
    text = f"The paper's verification press, fore finger: {PAPER_ERROR * 100:.2f} %."
    return Table(f"Five fingers, {hand.profile}", head, rows, text)


def _draw(hands: Sequence[Hands], figure: Any) -> None:
    """Figure 3 for each finger: pressure above rest against force, the held rows and the line of slope K."""
    figure.set_size_inches(15, 3.4 * len(hands))
    axes = figure.subplots(len(hands), len(NAMES), squeeze=False)
    for hand, row in zip(hands, axes, strict=True):
        for name, finger, ax in zip(NAMES, hand.fingers, row, strict=True):
            held, extra = np.concatenate([press.rows for press in finger.presses]), finger.verification.rows
            for rows, color, label in ((held, "#1d4ed8", "calibration"), (extra, "#c2410c", "verification")):
                ax.plot(rows["pressure"] - rows["rest"], rows["force_n"], ".", color=color, markersize=3, label=label)
            top = float((held["pressure"] - held["rest"]).max())
            ax.plot([0, top], [0, top * finger.fit.gain_n], color="#111111", linewidth=1, label="slope K")
            error = finger.verified.board_error
            ax.set_title(f"{name}, {hand.profile}: {finger.fit.gain_n * 1e3:.2f} mN/count, {error:.2%}", fontsize=9)
            ax.set(xlabel="P - P0 [count]", ylabel="F [N]")
            ax.grid(alpha=0.25)
    axes[0][0].legend(fontsize=8)
