"""Grip state: Eq 7 against the sum over all ways, and on skin that begins to slide."""

import itertools

import numpy as np
import pytest

from biotac.errors import InputError
from biotac.sim.stick_slip import Ringing
from biotac.wire.fields import FRAME_FIELDS, dtype_of
from biotac_lab.features.grip import GripFilter, GripState, Trained, load_ratio, observations, train

FRICTION = 0.6
NORMAL_N = 3.0
AT_MM = (-4.0, 0.0, -7.0)  # on the cylinder; the normal there is -z


def grasp(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Frames, PAC and states: held, loaded until it slides, caught."""
    rng = np.random.default_rng(seed)
    held, loading, slides, caught = (int(rng.integers(*span)) for span in ((80, 150), (60, 120), (15, 40), (80, 150)))
    ratio = np.concatenate(
        [np.full(held, 0.2), np.linspace(0.2, FRICTION, loading), np.full(slides, FRICTION), np.full(caught, 0.3)]
    )
    speed = np.zeros(len(ratio))
    speed[held + loading : held + loading + slides] = 20.0
    states = np.where(speed > 0, GripState.SLIPPING, GripState.STABLE)
    states[(ratio > 0.85 * FRICTION) & (speed == 0)] = GripState.INCIPIENT
    pac = np.rint(2038 + Ringing(rng)(speed) + rng.normal(0.0, 3.0, (len(ratio), 22))).clip(0, 4095).astype(np.uint16)
    rows = np.zeros(len(ratio), dtype_of([f for f in FRAME_FIELDS if f.name in ("force_n", "poc_mm")]))
    rows["poc_mm"] = AT_MM
    rows["force_n"][:, 2] = NORMAL_N + rng.normal(0.0, 0.05, len(ratio))
    rows["force_n"][:, 1] = ratio * NORMAL_N + rng.normal(0.0, 0.05, len(ratio))
    return rows, pac, states


@pytest.fixture(scope="module")
def trained() -> Trained:
    every = [grasp(seed) for seed in range(20)]
    return train(
        np.concatenate([observations(rows, pac) for rows, pac, _ in every]), np.concatenate([s for *_, s in every])
    )


def test_shares_are_those_of_all_ways_through_the_states(trained: Trained) -> None:
    rows, pac, _ = grasp(100)
    observed = observations(rows, pac)[:8]
    weights = trained.weigh(observed)
    at_end = np.zeros(3)
    for way in itertools.product(range(3), repeat=9):
        steps = [trained.transition[a, b] * weights[k, b] for k, (a, b) in enumerate(itertools.pairwise(way))]
        at_end[way[-1]] += trained.start[way[0]] * np.prod(steps)
    whole, pieces = GripFilter(trained), GripFilter(trained)
    np.testing.assert_allclose(whole.feed(observed)[-1], at_end / at_end.sum(), rtol=1e-9)
    pieces.feed(observed[:3])
    np.testing.assert_allclose(pieces.feed(observed[3:])[-1], at_end / at_end.sum(), rtol=1e-9)


def test_a_slip_is_seen_within_30_ms_and_a_hold_is_none(trained: Trained) -> None:
    late, held_rounds = [], 0
    for seed in range(200, 230):
        rows, pac, states = grasp(seed)
        guessed = GripFilter(trained).feed(observations(rows, pac)).argmax(axis=1)
        onset = int(np.argmax(states == GripState.SLIPPING))
        late.append(int(np.argmax(guessed[onset:] == GripState.SLIPPING)))
        held = guessed[:onset][states[:onset] == GripState.STABLE]
        assert (held != GripState.SLIPPING).all()
        held_rounds += len(held)
        assert (guessed[onset - 5 : onset] == GripState.INCIPIENT).any()
    assert np.mean(np.array(late) <= 3) >= 0.95
    assert held_rounds > 5000


def test_the_margin_is_what_friction_leaves(trained: Trained) -> None:
    assert trained.friction == pytest.approx(FRICTION, abs=0.1)
    force, at = np.array([[0.0, 0.9, 3.0], [0.0, 3.0, 3.0]]), np.array([AT_MM, AT_MM])
    np.testing.assert_allclose(load_ratio(force, at), [0.3, 1.0])
    np.testing.assert_allclose(trained.margin_n(force, at), 3.0 * (trained.friction - np.array([0.3, 1.0])))
    assert np.isnan(load_ratio([[0.0, 0.0, -1.0]], [AT_MM])).all()  # it pulls


def test_what_is_not_known_says_nothing(trained: Trained) -> None:
    start = GripFilter(trained).feed(np.full((1, 2), np.nan))
    np.testing.assert_allclose(start[0], trained.start @ trained.transition)
    rows, pac, _ = grasp(1)
    pac[10] = 0xFFFF
    assert np.isnan(observations(rows, pac)[10, 0]) and np.isfinite(observations(rows, pac)[12, 0])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda t: train(np.zeros((5, 2)), np.zeros(5, int)), "0 slipping"),
        (lambda t: train(np.zeros((5, 2)), np.full(5, 7)), "GripStates, one per round"),
        (lambda t: GripFilter(t).feed(np.zeros((3, 1))), "1 values per round"),
        (lambda t: GripFilter(t).feed(np.zeros(3)), r"\(n, k\)"),
        (lambda t: observations(np.zeros(3, [("force_n", "f8", 3)]), np.zeros((2, 22))), r"pac has shape \(2, 22\)"),
    ],
)
def test_bad_input_is_refused_in_words(trained: Trained, call, message: str) -> None:
    with pytest.raises(InputError, match=message):
        call(trained)
