"""`biotac calibrate press --weights`: masses on tilted blocks, and a recording; the rehearsal is in test_scale.py."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from biotac.calibrate import population as population_map
from biotac.calibrate.press import few_shot, weights
from biotac.calibrate.press.known_force import Held, found
from biotac.cli.main import main
from biotac.errors import InputError

G = 9.80665


@pytest.mark.parametrize(
    ("down", "force"),
    [
        ("the tip", (0.5, 0.0, 0.8660254)),
        ("the base", (-0.5, 0.0, 0.8660254)),
        ("E11's side", (0.0, 0.5, 0.8660254)),
        ("E1's side", (0.0, -0.5, 0.8660254)),
    ],
)
def test_a_block_turns_a_part_of_the_weight_to_the_side_that_is_down(down: str, force: tuple[float, ...]) -> None:
    load = weights.Load(300.0, 30.0, down)
    assert load.toward == pytest.approx(force)
    assert load.size_n == pytest.approx(0.3 * G)


def test_the_plan_is_every_mass_on_every_block() -> None:
    loads = weights.plan((200.0, 500.0), (10.0, 20.0))
    assert len(loads) == len(set(loads)) == 2 * (1 + 2 * 4)
    assert str(loads[0]) == "200 g on the pad, the block level"
    assert str(loads[-1]) == "500 g on the pad, the block tilted by 20 deg, E1's side down"


@pytest.mark.parametrize(
    ("masses", "tilts", "message"),
    [((), (15.0,), "50 to 2000 g"), ((5.0,), (), "masses of 5 g"), ((200.0,), (45.0,), "tilts of 45 deg")],
)
def test_weights_that_no_finger_holds_are_refused(
    masses: tuple[float, ...], tilts: tuple[float, ...], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        weights.plan(masses, tilts)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("weights") / "weights.mcap"
    assert main(["record", "sim:weights.toml", str(path)]) == 0
    return path


def test_a_recording_says_the_same_and_goes_to_no_board(recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    argv = ["calibrate", "press", str(recording), "--weights", "--finger", "0", "--json"]
    assert main(argv) == 0
    facts = json.loads(capsys.readouterr().out)
    assert np.linalg.norm(facts["held_out_n"]) < np.linalg.norm(facts["before_n"]) and not facts["why_not"]
    assert facts["serial"] == "BTSIM00000000009" and "board" not in facts
    assert np.linalg.norm(facts["force_n"], axis=1) == pytest.approx([0.2 * G, 0.5 * G] * 5)
    assert main([*argv, "--masses", "200,500,700"]) != 0  # more than were laid on it
    assert "press 11" in capsys.readouterr().err
    assert main([*argv, "--save"]) != 0
    assert "--save" in capsys.readouterr().err


def test_a_plate_corrects_directions_from_all_sides_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    step = '[[step]]\ndo = "{}"\nseconds = {}\n{}'
    text = 'name = "plate"\n' + step.format("rest", 2.0, "")
    for x, y in ((-3, 0), (2, 0), (-2, 0), (-4, 0), (-3, 2), (-3, -2), (-5, 2), (-5, -2), (1, 2), (1, -2)):
        text += step.format("press", 0.4, f"at_mm = [{x}.0, {y}.0]\nforce_n = 3.0\n") + step.format("hold", 1.4, "")
        text += step.format("press", 0.3, "force_n = 0\n") + step.format("rest", 2.0, "")
    (tmp_path / "plate.toml").write_text(text)
    recording = tmp_path / "plate.mcap"
    assert main(["record", f"sim:{tmp_path / 'plate.toml'}", str(recording)]) == 0
    capsys.readouterr()
    argv = ["calibrate", "press", str(recording), "--plate", "--finger", "index", "--json", "--force", "--presses"]
    assert main([*argv, "10"]) == 0
    facts = json.loads(capsys.readouterr().out)
    # population.md: 8 and 10 degrees on the halves of a real finger's recording
    assert facts["held_out_deg"] < min(10.0, facts["before_deg"])
    assert main([*argv, "5"]) != 0
    assert "roll the finger further to both sides" in capsys.readouterr().err


def test_axes_that_are_mixed_are_told_apart() -> None:
    """The limit of nine numbers: a finger that answers with the axes turned and stretched."""
    prior = population_map.load(None).population
    firm = replace(prior, coefficients=100.0 * prior.coefficients)  # so that the prior says little
    rng = np.random.default_rng(7)
    counts = 2800.0 - np.abs(rng.normal(200.0, 80.0, (12, 19)))
    tare = np.full(19, 2800.0)
    mixing = np.array([[0.9, 0.1, -0.1], [0.05, 1.2, 0.1], [0.1, -0.1, 1.1]])
    held = Held(counts, tare, np.arange(12), firm.force(counts, tare) @ mixing)
    result = found(firm, held, few_shot.WEIGHTS)
    assert (result.held_out_n < 0.2 * result.before_n).all()
