"""A held finger that is silent for a while: drift goes on meanwhile, and the force is as if there were no silence."""

import numpy as np
import pytest
from courses import Course, script

from biotac import Finger, FrameFlags, Setting
from biotac.wire import messages_gen as wire

LEAD_S, HELD_S = 3.0, 6.0
SETTLED = 5  # rounds, 50 ms
NEAR = 0.1
LIN = {wire.Setting.FORCE_MODEL: int(wire.ForceModel.LIN)}  # which the emulated finger's physics follow


WORN_LEAD_S = 10.0  # until the drift of all electrodes is known
CALIBRATED = {
    Setting.POC_WEIGHTS: 2,
    Setting.FORCE_GAIN_X_NN: 9_000_000,
    Setting.FORCE_GAIN_Y_NN: 3_000_000,
    Setting.FORCE_GAIN_Z_NN: 26_000_000,
    Setting.THERMAL_GAIN_MILLI: 0,
}


def held(
    seed: int, later_n: float = 3.0, *, profile: str = "new", lead_s: float = LEAD_S, held_s: float = HELD_S
) -> tuple[Course, int]:
    """3 N, held, and the row at which the finger falls silent; half a second later it holds ``later_n``."""
    begun = script(seed, profile, lead_s=lead_s).load(3.0, 6).hold(held_s)
    row = round(100 * begun.track.seconds)
    return begun.hold(0.5).load(later_n, 10).hold(12).make(), row


def silent(course: Course, begin: int, end: int, silent_rounds: int, settings=LIN) -> np.ndarray:
    """Rows from ``end`` on, after as many rounds without a word; device time says how long it was."""
    finger = Finger(settings)
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


@pytest.mark.parametrize("held_s", [1.0, 6.0])
@pytest.mark.parametrize("seed", range(401, 411))
def test_a_worn_finger_comes_back_with_its_force_however_young_the_hold(seed: int, held_s: float) -> None:
    course, row = held(seed, profile="worn", lead_s=WORN_LEAD_S, held_s=held_s)
    undisturbed = course.run(CALIBRATED)
    for rounds in (40, 200, 500, 1000):
        back = silent(course, row, row + rounds, rounds, CALIBRATED)
        assert (back["flags"] & FrameFlags.CONTACT != 0).all()
        assert greatest_error(back[:100], undisturbed[row + rounds :][:100]) <= NEAR, rounds


@pytest.mark.parametrize("later_n", [2.0, 2.7, 3.3, 4.0])
def test_a_load_that_changed_meanwhile_is_no_drift(later_n: float) -> None:
    course, row = held(5, later_n, lead_s=WORN_LEAD_S)
    back = silent(course, row, row + 500, 500)
    before = course.run()["tare_q4"][row - 1]
    moved = back["tare_q4"][: 2 * SETTLED] / 16.0 - before / 16.0
    drifted = course.rest[row + 500 : row + 500 + 2 * SETTLED] - course.rest[row - 1]
    # By the known drift, but for one electrode's own part: a fifth.
    assert np.abs(moved - drifted)[SETTLED:].max() <= 0.2 * np.abs(drifted).max() + 0.25


def test_a_recording_needs_no_silent_rounds_but_one() -> None:
    course, row = held(5)
    assert silent(course, row, row + 1000, 1).tobytes() == silent(course, row, row + 1000, 1000).tobytes()
