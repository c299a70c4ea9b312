"""A held finger that is silent for a while: drift goes on meanwhile, and the force is the one it would have had."""

from __future__ import annotations

import numpy as np
import pytest

from biotac import Finger, FrameFlags
from biotac.wire import messages_gen as wire
from stability.courses import Course, script

LEAD_S, HELD_S = 3.0, 6.0
SETTLED = 5  # rounds, 50 ms
NEAR = 0.05
LIN = {wire.Setting.FORCE_MODEL: int(wire.ForceModel.LIN)}  # which the emulated finger's physics follow


def held(seed: int, later_n: float = 3.0) -> tuple[Course, int]:
    """3 N, held, and the row at which the finger falls silent; half a second later it holds ``later_n``."""
    begun = script(seed, lead_s=LEAD_S).load(3.0, 6).hold(HELD_S)
    row = round(100 * begun.track.seconds)
    return begun.hold(0.5).load(later_n, 10).hold(12).make(), row


def silent(course: Course, begin: int, end: int, silent_rounds: int) -> np.ndarray:
    """Rows from ``end`` on, after as many rounds without a word; device time says how long it was."""
    finger = Finger(LIN)
    t_us = 10_000 * np.arange(len(course))
    finger.feed(**{name: words[:begin] for name, words in course.words.items()}, t_us=t_us[:begin])
    finger.feed(np.full((silent_rounds, 19), wire.INVALID_COUNT), t_us=t_us[end - silent_rounds : end])
    return finger.feed(**{name: words[end:] for name, words in course.words.items()}, t_us=t_us[end:])


def greatest_error(rows: np.ndarray, undisturbed: np.ndarray) -> float:
    force, wanted = rows["force_100un"][SETTLED:], undisturbed["force_100un"][SETTLED:]
    return float((np.linalg.norm(force - wanted, axis=1) / np.linalg.norm(wanted, axis=1)).max())


@pytest.mark.parametrize("seed", range(8))
def test_a_hold_comes_back_with_its_force(seed: int) -> None:
    course, row = held(seed)
    undisturbed = course.run(LIN)
    for rounds in (8, 40, 100, 200, 500, 1000):
        back = silent(course, row, row + rounds, rounds)
        assert (back["flags"] & FrameFlags.CONTACT != 0).all()
        assert greatest_error(back, undisturbed[row + rounds :]) <= NEAR, rounds


@pytest.mark.parametrize("later_n", [2.0, 2.7, 3.3, 4.0])
def test_a_load_that_changed_meanwhile_is_no_drift(later_n: float) -> None:
    course, row = held(5, later_n)
    back = silent(course, row, row + 500, 500)
    before = course.run(LIN)["tare_q4"][row - 1]
    assert (back["tare_q4"][: 2 * SETTLED] == before).all()


def test_a_recording_needs_no_silent_rounds_but_one() -> None:
    course, row = held(5)
    assert silent(course, row, row + 1000, 1).tobytes() == silent(course, row, row + 1000, 1000).tobytes()
