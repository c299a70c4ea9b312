"""`biotac calibrate press --scale`: guided on the emulated hand, from its recording, and held out."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from biotac.calibrate import population as population_map
from biotac.calibrate.population import Population
from biotac.calibrate.press.few_shot import scaled
from biotac.calibrate.press.known_force import Held, found
from biotac.cli.main import main
from biotac.errors import InputError
from biotac.map.file import load_fitted

TARE = np.full(19, 2800.0)


def held(prior: Population, gain: float, balance: float) -> tuple[Held, Population]:
    """Presses on a finger that is softer than the map by ``gain``, its plate tilted by ``balance``."""
    rng = np.random.default_rng(5)
    patterns = -np.abs(rng.normal(300.0, 80.0, (6, 19)))
    felt_n = prior.force(TARE + patterns, TARE)
    # the tilt is in what the map says, so that it is taken out of presses that were straight
    tilted = replace(prior, coefficients=prior.coefficients.copy())
    tilted.coefficients[:, 0] = balance * prior.coefficients[:, 2]
    return Held(TARE + patterns, TARE, np.arange(6), gain * felt_n[:, 2:] * [0.0, 0.0, 1.0]), tilted


@pytest.fixture
def firm() -> Population:
    """A map that says 10 to 100 N to such patterns, so that a press says more than what is known of fingers."""
    prior = population_map.load(None).population
    coefficients = np.zeros_like(prior.coefficients)
    coefficients[:38, 2] = -5.0  # compressions and bulges
    return replace(prior, coefficients=coefficients)


def test_presses_are_judged_each_by_the_others(firm: Population) -> None:
    presses, tilted = held(firm, 1.3, 0.08)
    judged = found(tilted, presses, scaled)
    x, _, z = judged.own.coefficients[:38].T
    assert z == pytest.approx(np.full(38, 1.3 * -5.0), rel=0.02)
    assert x == pytest.approx(np.zeros(38), abs=0.005 * 5.0)
    assert (judged.held_out_n[[0, 2]] < 0.1 * judged.before_n[[0, 2]]).all()
    assert judged.why_not(np.full(3, 100.0)) == ""
    assert "unlike those of the population map" in judged.why_not(np.full(3, 1e-3))


def test_a_reading_that_is_wrong_shows_held_out(firm: Population) -> None:
    presses, tilted = held(firm, 1.0, 0.0)
    presses.force_n[2] *= 5.0
    assert "no better than" in found(tilted, presses, scaled).why_not(np.full(3, 100.0))


def test_the_guide_on_the_emulated_hand(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "own.wrench.json"
    words = [
        *("calibrate", "press"),
        # An idle simulated board plays on: not to be over before a busy computer has fitted the map.
        *("sim:fingers.toml?fingers=1&seconds=2400", "--scale", "--finger", "index", "--presses", "3", "--json"),
    ]
    assert main([*words, "--out", str(out)]) == 1  # nothing was uploaded
    output = capsys.readouterr()
    assert "1 of 3: push the pad" in output.err and "biotac: " not in output.err  # prompts are no errors
    facts = json.loads(output.out)
    assert facts["shown_n"] == [2.0, 3.5, 5.0]
    assert load_fitted(out).axes == ("Fx", "Fy", "Fz")
    # the emulated finger is poked by a point and no flat: nothing for a map of flat plates
    assert facts["why_not"] and "board" not in facts
    assert main([*words, "--force"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["board"]["frames_bit_for_bit"] > 0 and facts["board"]["outside"] == 0


def test_a_recording_with_readings_says_the_same(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = tmp_path / "presses.mcap"
    assert main(["record", "sim:fingers.toml?fingers=1", str(recording)]) == 0
    capsys.readouterr()
    # four presses of the first finger are in it: 2, 3.5, 5 and 4 N; in grams
    grams = ",".join(f"{1000 * force / 9.80665:.2f}" for force in (2.0, 3.5, 5.0, 4.0))
    words = ["calibrate", "press", str(recording), "--scale", "--finger", "0", "--unit", "g", "--json"]
    words += ["--readings", grams]
    assert main(words) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["shown_n"] == pytest.approx([2.0, 3.5, 5.0, 4.0], abs=1e-4)
    assert facts["serial"] == "BTSIM00000000001"
    assert main([*words[:-1], "510,300"]) != 0
    assert "expected 3 or more" in capsys.readouterr().err
    assert main(words[:-2]) != 0
    assert "--readings" in capsys.readouterr().err


def test_too_few_presses_are_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["calibrate", "press", "sim:fingers.toml", "--scale", "--finger", "0", "--presses", "2"]) != 0
    assert "expected 3 or more" in capsys.readouterr().err
    with pytest.raises(InputError):
        population_map.load(Path("nowhere.json"))
