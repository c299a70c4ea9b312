"""`biotac calibrate press --scale`, and a rehearsal of it and of --weights: guided, from a recording, and held out."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from biotac.calibrate import population as population_map
from biotac.calibrate.population import Population
from biotac.calibrate.press import few_shot
from biotac.calibrate.press.few_shot import SCALE, Way
from biotac.calibrate.press.known_force import Held, found
from biotac.cli.main import main
from biotac.kernels.geometry import RADIUS_MM
from biotac.map.file import load_fitted
from biotac.sim.loading import bundled_scenario
from biotac.sim.physics import SimFinger, States
from biotac.sim.scenario import parse_scenario

TARE = np.full(19, 2800.0)


def held(prior: Population, gain: float, balance: float) -> tuple[Held, Population]:
    """Presses on a finger that is softer than the map by ``gain``, with a plate tilted by ``balance``."""
    rng = np.random.default_rng(5)
    patterns = -np.abs(rng.normal(300.0, 80.0, (6, 19)))
    felt_n = prior.force(TARE + patterns, TARE)
    # the tilt is in the map's force, so that it is taken out of presses that were straight
    tilted = replace(prior, coefficients=prior.coefficients.copy())
    tilted.coefficients[:, 0] = balance * prior.coefficients[:, 2]
    return Held(TARE + patterns, TARE, np.arange(6), gain * felt_n[:, 2:] * [0.0, 0.0, 1.0]), tilted


@pytest.fixture
def firm() -> Population:
    """A map that gives 10 to 100 N for such patterns, so that a press outweighs the prior of all fingers."""
    prior = population_map.load(None).population
    coefficients = np.zeros_like(prior.coefficients)
    coefficients[:38, 2] = -5.0  # compressions and bulges
    return replace(prior, coefficients=coefficients)


def test_presses_are_judged_each_by_the_others(firm: Population) -> None:
    presses, tilted = held(firm, 1.1, 0.08)
    judged = found(tilted, presses, SCALE)
    x, _, z = judged.own.coefficients[:38].T
    assert z == pytest.approx(np.full(38, 1.1 * -5.0), rel=0.02)
    assert x == pytest.approx(np.zeros(38), abs=0.005 * 5.0)
    assert (judged.held_out_n[[0, 2]] < 0.1 * judged.before_n[[0, 2]]).all()
    assert judged.why_not(np.full(3, 100.0)) == ""
    assert "unlike those of the population map" in judged.why_not(np.full(3, 1e-3))


def test_one_press_says_as_much_as_a_mean_with_its_prior() -> None:
    """By hand: a press of 5 N weighs 25 against (error / spread)^2, 76.5625 for the gain and 20.25 for the balance."""
    scale = few_shot.scale_of(np.array([[0.5, 0.3, 5.0]]), np.array([[0.0, 0.0, 6.0]]))
    assert (scale.gain, scale.gain_sigma) == pytest.approx((1.0 + 5.0 / 101.5625, 0.35 / 101.5625**0.5))
    assert (scale.balance, scale.balance_sigma) == pytest.approx((2.5 / 45.25, 0.45 / 45.25**0.5))


def test_a_reading_that_is_wrong_shows_held_out(firm: Population) -> None:
    presses, tilted = held(firm, 1.0, 0.0)
    presses.force_n[2] *= 5.0
    assert "no better than" in found(tilted, presses, SCALE).why_not(np.full(3, 100.0))


@pytest.mark.parametrize(
    ("gain", "way", "words"),
    [
        (1 / 9.80665, SCALE, "0.10 times what the map felt, expected 0.6 to 1.6; check the scale's unit (--unit kg"),
        (0.8, SCALE, "the gain of z is 0.80, expected 0.88 to 1.12"),
        (1.5, few_shot.WEIGHTS, "expected 0.70 to 1.30, as fingers have it; check the masses"),
    ],
)
def test_a_size_that_no_finger_explains_names_its_unit(firm: Population, gain: float, way: Way, words: str) -> None:
    presses, prior = held(firm, gain, 0.0)
    why_not = found(prior, presses, way).why_not(np.full(3, 1e3))
    assert words in why_not and "finger is unlike" not in why_not


def test_a_scale_that_holds_its_value_is_no_scale(firm: Population) -> None:
    presses, prior = held(firm, 1.0, 0.1)  # an x that gets better is no excuse
    growing = replace(presses, counts=TARE + np.linspace(0.9, 1.4, 6)[:, None] * (presses.counts[:1] - TARE))
    steady = np.tile([0.0, 0.0, firm.force(growing.counts, TARE)[:, 2].mean()], (6, 1))
    assert "is the scale's hold on?" in found(prior, replace(growing, force_n=steady), SCALE).why_not(np.full(3, 1e3))
    judged = replace(found(prior, presses, SCALE), before_n=np.array([9.0, 0, 1]), held_out_n=np.array([1.0, 0, 1.2]))
    assert "held out, z is off by 1.20 N, more than the 1.00 N" in judged.why_not(np.full(3, 1.1))
    assert not judged.why_not(np.full(3, 1.3))  # less than the map is known to
    assert judged.to_state_n(np.array([0.5, 0.3, 2.0])).tolist() == [1.0, 0.3, 1.2]


@pytest.mark.parametrize(
    ("against", "presses", "then"), [("--scale", 5, "let go"), ("--weights", 10, "take the weight off")]
)
def test_a_rehearsal_finds_what_the_scenario_hides(
    against: str, presses: int, then: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario, out = f"{against[2:]}.toml", tmp_path / "own.wrench.json"
    argv = ["calibrate", "press", f"sim:{scenario}?pace=fast", against, "--finger", "index", "--json"]
    assert main([*argv, "--out", str(out)]) == 0
    printed = capsys.readouterr()
    prompts = printed.err.splitlines()
    assert [line.split(" of ")[0] for line in prompts[1:-1:2]] == [str(k + 1) for k in range(presses)]
    assert prompts[2:-1:2] == [f"held: {then}"] * presses and prompts[-1] == "done"
    facts = json.loads(printed.out)
    assert facts["gain_sigma"] < few_shot.GAIN_SPREAD and facts["balance_sigma"] < few_shot.BALANCE_SPREAD
    assert not facts["why_not"] and facts["board"]["outside"] == 0

    # pressed straight between the places of the rehearsal: nearer to the applied force than by the map before
    (spec,) = parse_scenario(bundled_scenario(scenario), file=scenario).fingers
    x_mm, force_n = np.repeat([-3.5, -2.5, -1.0], 3), np.tile([2.5, 3.5, 5.0], 3)
    nothing, contact_mm = np.zeros(9), np.column_stack([x_mm, np.zeros(9), np.full(9, -RADIUS_MM)])
    states = States(contact_mm, force_n, np.zeros((9, 3)), nothing, np.full(9, 3.5), nothing)
    finger = SimFinger(spec.seed, spec.profile)
    own, population = load_fitted(out), population_map.load(None).population
    counts, rest = finger.counts(states), finger.rest_counts(np.zeros(1))[0]
    off_n, before_n = (
        np.linalg.norm(felt - states.wrench()[0]) / 3.0
        for felt in (own.predict(own.tare + counts - rest), population.force(counts, rest))
    )
    assert off_n < before_n < 2.0


def test_presses_that_the_map_does_not_know_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    step = '[[step]]\ndo = "{}"\nseconds = {}\n{}'
    pokes = [step.format("rest", 2.0, "")]
    for name, force_n in (("E2", 2.0), ("E12", 3.5), ("E9", 5.0)):  # from all sides, and with a pin
        pokes += [step.format("press", 0.4, f'at = "{name}"\ntip_mm = 1.0\nforce_n = {force_n}\n')]
        pokes += [
            step.format("hold", 1.4, ""),
            step.format("press", 0.3, "force_n = 0\n"),
            step.format("rest", 2.0, ""),
        ]
    (tmp_path / "pokes.toml").write_text('name = "pokes"\n' + "".join(pokes))
    # An idle simulated board plays on: not to be over before a busy computer has fitted the map.
    argv = [
        "calibrate",
        "press",
        f"sim:{tmp_path / 'pokes.toml'}?seconds=2400&pace=fast",
        "--scale",
        "--finger",
        "index",
    ]
    out = tmp_path / "poked.wrench.json"
    argv += ["--presses", "3", "--json", "--out", str(out)]
    assert main(argv) == 1 and not out.exists()
    facts = json.loads(capsys.readouterr().out)
    assert facts["shown_n"] == [2.0, 3.5, 5.0] and "board" not in facts
    assert facts["why_not"] and facts["refused"]
    assert main([*argv, "--force"]) == 0
    assert json.loads(capsys.readouterr().out)["board"]["frames_bit_for_bit"] > 0
    assert json.loads(out.read_text())["provenance"]["not_worth_using"] == facts["why_not"]
    put = ["calibrate", "put", "sim:press.toml?seconds=2400", str(out), "--finger", "0"]
    assert main(put) == 2 and "is not worth using: " in capsys.readouterr().err
    assert main([*put, "--force"]) == 0


def test_a_recording_with_readings_says_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = tmp_path / "presses.mcap"
    assert main(["record", "sim:fingers.toml?fingers=1", str(recording)]) == 0
    capsys.readouterr()
    # the recording has four presses of the first finger: 2, 3.5, 5 and 4 N; in grams
    grams = ",".join(f"{1000 * force / 9.80665:.2f}" for force in (2.0, 3.5, 5.0, 4.0))
    argv = ["calibrate", "press", str(recording), "--scale", "--finger", "0", "--unit", "g", "--json"]
    argv += ["--readings", grams]
    assert main(argv) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["shown_n"] == pytest.approx([2.0, 3.5, 5.0, 4.0], abs=1e-4)
    assert facts["serial"] == "BTSIM00000000001"
    for readings, words in (
        ("510,300", "expected 3 or more"),
        ("204,357,510", "the recording has 4 presses, 3 readings"),
        ("204,357,510,20000", "up to 20000 g: expected less than 100 N; name the scale's unit"),
    ):
        assert main([*argv[:-1], readings]) == 2
        assert words in capsys.readouterr().err
    assert main(argv[:-2]) != 0
    assert "--readings" in capsys.readouterr().err


def test_too_few_presses_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "press", "sim:fingers.toml", "--scale", "--finger", "0", "--presses", "2"]) != 0
    assert "expected 3 or more" in capsys.readouterr().err
