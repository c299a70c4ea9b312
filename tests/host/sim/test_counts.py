"""Counts of simulated fingers, to the bit: a hash changes only with the model or its numbers."""

import copy
import hashlib
import pickle
import sys
from collections import Counter
from types import CodeType
from typing import Any

import numpy as np
import pytest

from biotac.sim import Course, SimFinger, SimTouch, bundled_scenarios, load_source, physics, touch
from biotac.sim.live import LiveFingers
from biotac.sim.touch import Load
from biotac.wire import sensor_gen as sensor
from biotac.wire import slots

SCENARIOS = {
    "calibrate.toml": "33d99a1757f4e853",
    "drift.toml": "16a1c2fd206c950b",
    "faults.toml": "a21a23ea25e0e909",
    "fingers.toml": "b44186d83302bbba",
    "grasp.toml": "940facfd94327d96",
    "poke.toml": "276e204d02a134c4",
    "press.toml": "26605d175137d200",
    "scale.toml": "01a71304a5c74bce",
    "shear.toml": "93836b4c0376ec78",
    "verbs.toml": "26600e09dbcc91dd",
    "weights.toml": "42a0c381d791c47d",
}
COURSES = {
    "0 new": "80af3e9dc3e553cb",
    "0 worn": "ab67225e0900a1da",
    "1 new": "8755b988e3a4467b",
    "1 worn": "b1ff0ee30392660d",
    "2 new": "7f47d4c7e7aa96a4",
    "2 worn": "6a37e2815d1945e4",
}


def digest(words: np.ndarray) -> str:
    return hashlib.sha256(words.astype("<u2").tobytes()).hexdigest()[:16]


def contact(rng: np.random.Generator, celsius: float) -> SimTouch:
    """A touch of any kind: from faint to firm, dragged, turned, sliding, on an electrode or beside it."""
    some = rng.random(6)
    place = str(rng.choice(sensor.ELECTRODE_NAMES)) if some[0] < 0.4 else (rng.uniform(-14, 3), rng.uniform(-4, 4))
    shear_n = tuple(rng.normal(size=2) * (some[1] < 0.6))
    return SimTouch(
        rng.choice([0.0, rng.uniform(0, 0.1), rng.uniform(0.1, 8), rng.uniform(0, 50)], p=[0.1, 0.15, 0.7, 0.05]),
        shear_n, at=place, torsion_nmm=8 * rng.normal() * (some[2] < 0.5), tip_mm=rng.choice([0.5, 1, 2, 3, 7, 10]),
        slip_mm_s=40 * some[3] * (some[4] < 0.3), celsius=celsius,
    )  # fmt: skip


def load(rng: np.random.Generator, k: int) -> Load:
    """A load of round ``k``: none, a contact, several at once, or a course of either."""
    celsius = 30.0 + 3.0 * np.sin(k / 90) * (k % 400 > 200)
    kind = rng.integers(7)
    if kind == 0:
        return None
    if kind < 4:
        return contact(rng, celsius)
    if kind == 4:
        return [contact(rng, celsius) for _ in range(rng.integers(1, 4))]
    if kind == 5:
        return Course(contact(rng, celsius) for _ in range(rng.integers(7)))
    return Course([contact(rng, celsius) for _ in range(rng.integers(1, 4))] for _ in range(rng.integers(1, 5)))


def course(seed: int, profile: Any) -> np.ndarray:
    """The words of two fingers, at both ends of their spread, under 600 loads some of which stay for more rounds."""
    fingers = {"a": SimFinger(seed, profile), "b": SimFinger(seed + 100, profile)}
    for spread, finger in zip((-1.0, 1.0), fingers.values(), strict=True):
        finger.at_spread(*np.roll([spread, 0.3 * spread, -0.7 * spread], seed))
    live, rng, held, words = LiveFingers(fingers), np.random.default_rng([seed, 99]), {}, []
    for k in range(600):
        if rng.random() < 0.7:
            held = {name: load(rng, k) for name in fingers if rng.random() < 0.9}
        words.append(live.read(held, int(rng.choice([1, 1, 1, 5]))))
    return np.concatenate(words)


# calibrate_gaps.toml begins with the minute that calibrate.toml does.
@pytest.mark.parametrize("name", sorted({*bundled_scenarios()} - {"calibrate_gaps.toml"}))
def test_a_scenario_s_counts_are_those_of_before(name: str) -> None:
    assert digest(load_source(name, fingers=5, seconds=60).samples) == SCENARIOS[name]


@pytest.mark.parametrize(("seed", "profile"), [(seed, profile) for seed in range(3) for profile in ("new", "worn")])
def test_counts_under_loads_of_all_kinds_are_those_of_before(seed: int, profile: str) -> None:
    assert digest(course(seed, profile)) == COURSES[f"{seed} {profile}"]


def test_what_depends_on_the_load_alone_is_computed_once() -> None:
    calls: Counter[CodeType] = Counter()
    live = LiveFingers({"a": SimFinger(1), "b": SimFinger(2)})
    sys.setprofile(lambda frame, event, _: calls.update([frame.f_code] if event == "call" else []))
    for force_n in (1.375, 1.375, 1.375, 2.625, 1.375):
        live.read({name: SimTouch(force_n, at=(-3.125, 1.625)) for name in "ab"}, 2)
    sys.setprofile(None)
    assert calls[physics.deform.__code__] == 2


def test_a_finger_that_changes_is_read_as_it_is_now() -> None:
    finger = SimFinger(1)
    live = LiveFingers({"a": finger})
    before = live.read({"a": SimTouch(4.0)}, 2)[-1, 0].astype(int)
    finger.pressure_gain *= 2.0
    finger.r0_ohm[:] *= 2.0  # in place
    finger.drift_per_min = np.zeros(19)
    after = live.read({"a": SimTouch(4.0)}, 2)[-1, 0].astype(int)
    assert after[slots.PDC_SLOT] > before[slots.PDC_SLOT] + 100
    assert (after[slots.ELECTRODE_SLOT] < before[slots.ELECTRODE_SLOT] - 100).sum() > 9


@pytest.mark.parametrize("again", [copy.deepcopy, lambda thing: pickle.loads(pickle.dumps(thing))])
def test_states_and_skins_can_be_copied_once_they_have_been_used(again: Any) -> None:
    states = touch.states(SimTouch(2.0))[0]
    wanted = states.deformation
    for felt, skin in ((again(states), physics.SKIN), (states, again(physics.SKIN))):
        np.testing.assert_array_equal(physics.deform(felt, skin=skin), wanted)
