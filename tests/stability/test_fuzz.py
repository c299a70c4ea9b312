"""Random courses of loads, a few by day and hundreds nightly, and the proof that their verdicts can fail."""

import os
from functools import cache

import numpy as np
import pytest
import random_courses

from biotac import TareReason, TareState


@pytest.mark.parametrize("seed", range(5))
def test_a_random_course_breaks_nothing(seed: int) -> None:
    recipe = random_courses.draw(seed)
    assert random_courses.judge(recipe).broken == [], recipe


@pytest.mark.nightly
@pytest.mark.parametrize("number", range(300))
def test_hundreds_of_other_courses_each_night(number: int) -> None:
    seed = int(os.environ.get("BIOTAC_SEED", "1")) * 1000 + number
    test_a_random_course_breaks_nothing(seed)
    assert random_courses.rest(seed, 600.0, worn=False) == 0


@pytest.mark.parametrize("seed", [33, 58, 75, 114, 118, 123, 214])
def test_courses_that_once_broke_something_do_not_again(seed: int) -> None:
    # 33, 214: a press tared by its sudden release; 58, 75, 123: a light contact ended by one lost pressure word;
    # 114: released while warm; 118: lost words began the stillness anew.
    assert random_courses.judge(random_courses.draw(seed)).broken == []


@pytest.mark.parametrize("seed", [8, 37])
def test_what_comes_back_of_an_undershoot_is_no_touch(seed: int) -> None:
    assert random_courses.judge(random_courses.draw(seed)).idle_touches == 0


def test_hours_of_rest_without_glitches_have_no_contact() -> None:
    assert sum(random_courses.rest(seed, 600.0, worn=False) for seed in range(12)) == 0


def spoilt(change) -> list[str]:
    """The verdict on a course when the board's rows are changed on the way to it."""
    recipe, course, settings, rows = plain_course()
    change(rows := rows.copy())
    return random_courses.verdict(recipe, course, settings, rows).broken


@cache
def plain_course() -> tuple:
    """Made and run once: what the board makes of it is the same for every verdict."""
    recipe = next(filter(is_plain, map(random_courses.draw, range(200))))
    return recipe, *random_courses.run(recipe)


def is_plain(recipe: random_courses.Recipe) -> bool:
    """A quiet sensor with pressure, and a load that must be held."""
    return recipe.pdc and recipe.profile == "new" and any(how.get("force_n", 0) > 3 for _, how in recipe.steps)


def forget_contacts(rows: np.ndarray) -> None:
    rows["tare_state"] = TareState.REST


def never_release(rows: np.ndarray) -> None:
    rows["tare_state"][2000:] = TareState.CONTACT


def doubt_for_ever(rows: np.ndarray) -> None:
    rows["tare_state"][2000:] = TareState.DOUBT


def no_such_state(rows: np.ndarray) -> None:
    rows["tare_state"][2000] = max(TareState) + 1


def tare_a_load(rows: np.ndarray) -> None:
    first = int(np.flatnonzero(rows["tare_state"] == TareState.CONTACT)[0])
    begins = rows["tare_state"] == TareState.CONTACT
    rows["flags"][begins] |= 1 << 14
    rows["tare_reason"][first:] = TareReason.RELEASE


def touch_at_rest(rows: np.ndarray) -> None:
    rows["flags"][500] |= 1 << 14
    rows["tare_reason"][500] = TareReason.ROLL_BACK


def wrong_force(rows: np.ndarray) -> None:
    rows["force_100un"][1500, 1] += 2


def lose_a_number(rows: np.ndarray) -> None:
    rows["seq"][700:] += 1


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (forget_contacts, "the finger is at rest"),
        (never_release, "in contact for more than"),
        (doubt_for_ever, "not tared within"),
        (no_such_state, "a tare state is unknown"),
        (tare_a_load, "was tared away"),
        (touch_at_rest, "contact without load"),
        (wrong_force, "force y off by"),
        (lose_a_number, "the sequence has a gap"),
    ],
)
def test_every_verdict_can_fail(change, words: str) -> None:
    assert any(words in broken for broken in spoilt(change))
