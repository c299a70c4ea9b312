"""Pressure calibration: formulas, plateaus, K, the guided sequence, and the number that each refusal names.

Truth is made here: pressures are F / K + P0 with noise and ramps, times are counted and never waited for.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from biotac import InputError
from biotac.calibrate.press import pressure
from biotac.calibrate.press.detector import GIVE_UP_ROWS, HOLD_ROWS, Phase, Press, Presses, PressStep, Procedure, Rest
from biotac.calibrate.press.force_source import ROW_DTYPE
from biotac.calibrate.press.guide import ask_forces
from biotac.calibrate.press.pressure import PressureFit, fit, verify, with_board_force

K = 0.0125  # N per count
REST = 1300.0
ROUND_US = 10_000


def course(
    force_n: Any, *, finger: int = 0, k: float = K, noise: float = 0.0, alpha: float = 0.5, seed: int = 1
) -> Any:
    """Rows of a finger under these forces (n,), with a pressure exactly linear, filtered as the paper has it."""
    force = np.asarray(force_n, np.float64)
    words = REST + force / k + np.random.default_rng(seed).normal(0.0, 1.0, len(force)) * noise
    rows = np.zeros(len(force), ROW_DTYPE)
    rows["finger"], rows["t_us"] = finger, np.arange(len(force)) * ROUND_US
    for k in range(1, len(words)):
        words[k] = alpha * words[k] + (1.0 - alpha) * words[k - 1]
    rows["pressure"], rows["rest"] = words, REST
    rows["board_n"], rows["force_n"] = np.nan, force
    rows["touched"] = force > 0.05
    return rows


def press(force_n: float, *, ramp: int = 40, hold: int = 140, rest: int = 120) -> list[float]:
    return [*np.linspace(0, force_n, ramp), *[force_n] * hold, *np.linspace(force_n, 0, ramp), *[0.0] * rest]


def presses(*forces_n: float, **how: int) -> list[float]:
    return [0.0] * 150 + [f for force_n in forces_n for f in press(force_n, **how)]


def ran(rows: Any, count: int = 3) -> Presses:
    machine = Presses(0, count)
    feed_rows(machine, rows)
    machine.finish()
    return machine


def feed_rows(machine: Presses, rows: Any) -> None:
    for row in rows:
        if not machine.done:
            machine.add(row)


def its_fit(rows: Any) -> PressureFit:
    machine = ran(rows)
    assert machine.rest is not None
    return fit(machine.rest, machine.presses)


# ---- formulas ----------------------------------------------------------------------------------


def test_k_is_the_pseudo_inverse() -> None:
    above, force = np.array([100.0, 200.0, 300.0]), np.array([1.0, 2.2, 2.9])
    # By hand: sum P F / sum P^2 = (100 + 440 + 870) / (1 + 4 + 9) / 1e4
    assert pressure.gain_of(above, force) == pytest.approx(1410 / 140_000, rel=1e-12)
    assert pressure.relative_error(np.array([3.0, 4.4]), np.array([3.0, 4.0])) == pytest.approx(0.4 / 5.0)


# ---- plateaus ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("noise", "k"), [(0.0, 0.009), (3.0, 0.016)])
def test_three_presses_give_k(noise: float, k: float) -> None:
    fitted = its_fit(course(presses(2, 3.5, 5), k=k, noise=noise))
    # A mean of n noisy counts: 3 sigma of 3 * 50 rows of filtered noise, against the rms of the pressure applied.
    allowed = 3 * noise / np.sqrt(fitted.rows) / (3.7 / k) + 1e-9
    assert fitted.gain_n == pytest.approx(k, rel=allowed)
    assert fitted.rows == 3 * HOLD_ROWS
    assert fitted.rest.counts == pytest.approx(REST, abs=3 * noise / np.sqrt(50) + 1e-9)


def test_ramps_are_left_out_and_would_bias_k() -> None:
    rows = course(presses(2, 3.5, 5, ramp=30), alpha=0.1)
    assert its_fit(rows).gain_n == pytest.approx(K, rel=1e-3)
    rising = rows[np.gradient(rows["force_n"]) > 0]
    biased = pressure.gain_of(rising["pressure"] - rising["rest"], rising["force_n"])
    assert biased > 1.03 * K  # the points of the course show it


@pytest.mark.parametrize("chunk", [1, 300])
def test_how_rows_are_cut_makes_no_difference(chunk: int) -> None:
    rows = np.concatenate([course(presses(2, 3.5, 5), finger=f, noise=1.0, seed=f) for f in range(2)])
    rows["t_us"][len(rows) // 2 :] += len(rows) // 2 * ROUND_US
    whole, cut = Procedure([0, 1], [2, 3.5, 5]), Procedure([0, 1], [2, 3.5, 5])
    whole.feed(rows)
    for at in range(0, len(rows), chunk):
        cut.feed(rows[at : at + chunk])
    assert whole.done and cut.done
    assert whole.rests == cut.rests
    for finger in range(2):
        for a, b in zip(whole.presses[finger], cut.presses[finger], strict=True):
            assert a.rows.tobytes() == b.rows.tobytes()


def changed(rows: Any, change: Callable[[Any], None]) -> Any:
    out = rows.copy()
    change(out)
    return out


def noisy(rows: Any) -> None:
    rows["pressure"] += 30 * np.sin(np.arange(len(rows)) / 12)


def untared(rows: Any) -> None:
    rows["rest"] = np.nan


def touched(rows: Any) -> None:
    rows["touched"] = True


def railed(rows: Any) -> None:
    high = rows["force_n"] > 1
    rows["pressure"][high], rows["railed"][high] = np.nan, True


def without_force(rows: Any) -> None:
    rows["force_n"] = np.nan


GOOD = course(presses(2, 3.5, 5), noise=1.0)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (GOOD[:30], r"finger 0, 30 rows: never at rest: at most 30 untouched rows in a row.*expected 50"),
        (changed(GOOD, noisy), r"never at rest.*the steadiest moved by \d+\.\d+ counts \(limit"),
        (changed(GOOD, untared), r"never at rest: at most 0 untouched rows"),
        (changed(GOOD, touched), r"never at rest: at most 0 untouched rows"),
        (
            course([0.0] * 900),
            r"press 1 of 3 never came: pressure rose by at most 0\.0 counts, expected 20; press harder",
        ),
        (course(presses(0.1, 0.1, 0.1)), r"press 1 of 3 never came: pressure rose by at most 8\.0 counts"),
        (course(presses(2, 3.5, 5, hold=20)), r"press 1 of 3 has no plateau: at most \d+ held rows in a row"),
        (
            course([0.0] * 150 + list(np.linspace(0, 20, 900))),
            r"has no plateau: at most 0 held.*moved by \d+\.\d+ counts",
        ),
        (changed(GOOD, railed), r"at the end of its range in \d+ rows; expected none; press less"),
        (changed(GOOD, without_force), r"press 1 of 3 has no reference: it gave no force in \d+ held rows"),
        (course([0.0] * 150 + [3.0] * 300), r"press 1 was not released"),
    ],
)
def test_presses_that_cannot_be_used_are_refused_with_a_number(rows: Any, message: str) -> None:
    with pytest.raises(InputError, match=message):
        ran(rows)


def test_a_minute_in_vain_is_enough() -> None:
    machine = Presses(0, 3)
    feed_rows(machine, course([0.0] * 150))
    assert machine.phase is Phase.PRESS
    with pytest.raises(InputError, match=r"press 1 of 3 never came"):
        feed_rows(machine, course([0.0] * GIVE_UP_ROWS))


# ---- the sequence --------------------------------------------------------------------------------


def test_another_fingers_press_is_not_taken_for_this_ones() -> None:
    procedure = Procedure([0], [2.0, 3.5, 5.0])
    own, other = course([0.0] * 2000), course(presses(2, 3.5, 5), finger=1)
    procedure.feed(np.concatenate([own, other]))
    assert procedure.step is not None and procedure.step.press == 1
    with pytest.raises(InputError, match=r"finger 0, \d+ rows: press 1 of 3 never came"):
        procedure.finish()


def test_who_presses_faster_than_they_type_is_asked_for_every_press_once() -> None:
    """All rows come at once, as after a long wait for a number."""
    asked: list[tuple[int, int, float]] = []

    class Slow:
        def show(self, step: PressStep | None) -> None: ...

        def force_n(self, step: PressStep) -> float:
            asked.append((step.finger, step.press, step.force_n))
            return 10.0 * step.press

    procedure = Procedure([0], [2.0, 3.5, 5.0], needs_force=False)
    typed: list[float] = []
    procedure.feed(changed(GOOD, without_force))
    for _ in range(2):
        ask_forces(procedure, typed, Slow())
    assert procedure.done
    assert asked == [(0, 1, 2.0), (0, 2, 3.5), (0, 3, 5.0)]
    assert typed == [10.0, 20.0, 30.0]


@pytest.mark.parametrize(("fingers", "forces"), [([1, 1], [2.0]), ([0], []), ([0], [500.0])])
def test_no_sequence_without_fingers_or_forces(fingers: list[int], forces: list[float]) -> None:
    with pytest.raises(InputError, match="expected"):
        Procedure(fingers, forces)


def test_every_finger_ends_a_series_before_the_next_begins() -> None:
    procedure = Procedure([3, 1], [2.0, 4.0], [3.0])
    at_us, turns = 0, []
    for finger, forces in ((3, (2, 4)), (1, (2, 4)), (3, (3,)), (1, (3,))):
        rows = course(presses(*forces), finger=finger)
        rows["t_us"] += at_us
        at_us = int(rows["t_us"][-1]) + ROUND_US
        procedure.feed(rows)
        turns.append(procedure.step and (procedure.step.finger, procedure.step.press, procedure.step.presses))
    assert turns == [(1, 1, 2), (3, 1, 1), (1, 1, 1), None]
    assert [press.force_n for press in procedure.presses[3]] == pytest.approx([2.0, 4.0, 3.0], rel=0.01)
    assert [(press.finger, step.force_n) for press, step in procedure.asked()] == [
        (3, 2.0), (3, 4.0), (1, 2.0), (1, 4.0), (3, 3.0), (1, 3.0)
    ]  # fmt: skip


# ---- fit -----------------------------------------------------------------------------------------


def held(force_n: float, counts: float, number: int = 1, rows: int = HOLD_ROWS) -> Press:
    out = np.zeros(rows, ROW_DTYPE)
    out["pressure"], out["rest"], out["force_n"] = REST + counts, REST, force_n
    out["board_n"] = np.nan
    return Press(0, number, out)


STILL = Rest(REST, 0.6, 50)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ([held(2, 200), held(3, 300)], "finger 0: 2 presses, expected at least 3"),
        ([held(2, 200), held(np.nan, 300, 2), held(4, 400)], "press 2: the reference is nan N while"),
        ([held(2000, 200), held(3000, 300), held(4000, 400)], r"K is 10 N/count.*is the reference in newtons,"),
        ([held(-2, 200), held(3, 300), held(4, 400)], "the reference is -2 N while pressure is 200 counts above rest"),
        ([held(1, 200), held(3, 300), held(6, 400)], r"0.005 to 0.015 N/count, a spread of \d+%, expected at most 50%"),
    ],
)
def test_a_fit_that_would_be_wrong_is_refused_with_a_number(given: list[Press], message: str) -> None:
    with pytest.raises(InputError, match=message):
        fit(STILL, given)


def test_presses_that_disagree_a_little_are_noted() -> None:
    fitted = fit(STILL, [held(2.0, 200), held(3.3, 300), held(4.8, 400)])
    assert len(fitted.notes) == 1 and "spreads by 18%" in fitted.notes[0]
    assert not fit(STILL, [held(2.0, 200), held(3.0, 300), held(4.1, 400)]).notes


def test_the_verification_counts_scatter_as_well_as_offset() -> None:
    fitted = fit(STILL, [held(2, 200), held(3, 300), held(4, 400)])
    assert (fitted.gain_n, fitted.gain_nn) == (pytest.approx(0.01), 10_000_000)
    wrong = with_board_force(held(3.0, 330), fitted.gain_nn)
    seen = verify(fitted, wrong)
    assert (seen.board_error, seen.float_error) == (pytest.approx(0.1), pytest.approx(0.1))
    rows = wrong.rows.copy()
    rows["board_n"] = np.tile([2.7, 3.3], HOLD_ROWS // 2)  # right in the mean
    assert verify(fitted, Press(0, 1, rows)).board_error == pytest.approx(0.1)


def test_the_boards_own_code_tells_the_force_within_its_rounding() -> None:
    fitted = its_fit(course(presses(2, 3.5, 5), noise=1.0))
    rows = course([4.0] * HOLD_ROWS, noise=1.0, seed=9)
    rows["pressure"] = np.rint(rows["pressure"] * 16) / 16  # as published
    seen = verify(fitted, with_board_force(Press(0, 4, rows), fitted.gain_nn))
    assert 0 < seen.apart_n <= 0.5e-4 + 1e-9
    assert abs(seen.board_error - seen.float_error) < 1e-4
