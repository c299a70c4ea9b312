"""`biotac calibrate press --pressure` and an experiment: on the emulated hand, on recordings, and in refusals."""

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import biotac
from biotac.calibrate.press.detector import PressStep
from biotac.calibrate.press.pressure import CALIBRATION_FORCES_N, VERIFICATION_FORCES_N
from biotac.calibrate.press.pressure_procedure import calibrate
from biotac.cli.main import main
from biotac.keep import calibration_file as file
from biotac.recording.reader import Recording
from biotac.sim.loading import load_source
from biotac.sim.physics import PRESSURE_SPREAD, SimFinger
from biotac_lab.experiments import navarro2015 as navarro

FORCES = (*CALIBRATION_FORCES_N, *VERIFICATION_FORCES_N)
FINGERS = range(5)

# The emulated pressure is 100 N^-1 F (1 + 0.15 tanh(x / 8 mm)) times the finger's own gain, with two lags that no K can
# follow (biotac/sim/sampling.py): up to U = 9 counts too low while it is pressed, and 0.15 of a lag of 60 s too high.
# Least squares over presses of f counts turn the first into at most U sum(f) / sum(f^2) of K, where the factors of
# place and finger are least, 1 - 0.15 and 1 / 1.5; the second, over the 1.8 s of a ramp and a hold since the tare, into
# 0.15 * 1.8 / 60. A tare that is taken in the 1.5 s of rest may still be low by U exp(-1.1 / 0.8): 0.3 s of 1.5 settle,
# and 0.8 s is the lag.
_COUNTS = np.array(CALIBRATION_FORCES_N) * 100 * (1 - 0.15) / PRESSURE_SPREAD
_PER_COUNT = _COUNTS.sum() / (_COUNTS**2).sum()
K_HIGH = 9 * _PER_COUNT
K_LOW = 0.15 * 1.8 / 60 + 9 * np.exp(-1.1 / 0.8) * _PER_COUNT


def gain_at_e17(seed: int) -> float:
    """N per count by the emulated sensor's law without the lags; E17 is at x = -2.8 mm."""
    return float(0.01 / SimFinger(seed).pressure_gain / (1 + 0.15 * np.tanh(-2.8 / 8)))


class Silent:
    """Nobody is there; the steps are kept."""

    def __init__(self) -> None:
        self.steps: list[PressStep | None] = []

    def show(self, step: PressStep | None) -> None:
        self.steps.append(step)

    def force_n(self, step: PressStep) -> float:
        raise AssertionError("the scenario knows the force")


# ---- emulated hand -------------------------------------------------------------------------------


def test_the_guided_calibration_of_five_fingers(tmp_path: Path, capsys) -> None:
    port = "sim:fingers.toml?pace=fast"
    assert main(["calibrate", "press", port, "--pressure", "--save", "--json", "--out", str(tmp_path)]) == 0
    output = capsys.readouterr()
    facts = json.loads(output.out)
    assert [finger["finger"] for finger in facts["fingers"]] == [0, 1, 2, 3, 4]
    for finger in facts["fingers"]:
        assert -K_LOW <= finger["gain_n"] / gain_at_e17(finger["finger"] + 1) - 1 <= K_HIGH
        assert finger["rest_counts"] == pytest.approx(SimFinger(finger["finger"] + 1).pdc_rest, abs=1)
        assert finger["verification"]["board_error"] <= 0.059
        assert finger["verification"]["board_error"] == pytest.approx(finger["verification"]["float_error"], abs=1e-4)
        own = file.load(tmp_path / f"finger{finger['finger']}.json")
        assert (own.pressure_gain_nn, own.serial) == (finger["pressure_gain_nn"], finger["serial"])
        assert own.serial == f"BTSIM{finger['finger'] + 1:011d}"
        provenance = json.loads((tmp_path / f"finger{finger['finger']}.json").read_text())["provenance"]
        assert provenance["from"] == port and provenance["rows"] == 150
    assert output.err.splitlines()[:3] == [
        "let go of finger 0, and do not touch it",
        "1 of 3: press finger 0 with about 2 N, and hold still",
        "held: let go of finger 0",
    ]


PACE = 5  # of boards on which time passes: the pipe to a slow program holds 2 s of board time


def write_patient_scenario(folder: Path) -> Path:
    """One finger's presses, the last one every half minute: a busy computer is late for the first, and others."""
    rests_s = [1.5, 1.5, *[30.0] * 11]
    path = folder / "patient.toml"
    text = 'name = "patient"\n[[step]]\ndo = "rest"\nseconds = 1.5\n'
    for force_n, rest_s in zip((*CALIBRATION_FORCES_N, *VERIFICATION_FORCES_N * 10), rests_s, strict=True):
        text += (
            f'[[step]]\ndo = "press"\nseconds = 0.4\nat = "E17"\nforce_n = {force_n}\n'
            '[[step]]\ndo = "hold"\nseconds = 1.4\n'
            '[[step]]\ndo = "press"\nseconds = 0.4\nforce_n = 0.0\n'
            f'[[step]]\ndo = "rest"\nseconds = {rest_s}\n'
        )
    path.write_text(text)
    return path


class Scale(Silent):
    """Somebody reads a scale, and the scale shows the newtons that were asked for."""

    def force_n(self, step: PressStep) -> float:
        return step.force_n


@pytest.mark.nightly
def test_a_board_whose_time_passes_is_calibrated_to_a_scale_in_one_session(tmp_path: Path) -> None:
    """As a real one: nothing behind it knows a force; stopped and set, with the finger's own values kept."""
    with biotac.open(f"sim:{write_patient_scenario(tmp_path)}?pace={PACE}") as hand:
        hand.board.set_calibration(0, biotac.Calibration(thermal_gain_milli=321))
        hand.link.source = None
        (found,) = calibrate(hand, Scale(), fingers=(0,), made_s=77)
        assert hand.board.calibration(0) == found.calibration
    own = found.calibration
    assert (own.thermal_gain_milli, own.made_s, own.serial) == (321, 77, "BTSIM00000000001")
    assert found.verified.board_error <= 0.059
    assert found.fit.press_forces_n == CALIBRATION_FORCES_N


class Wrong(Scale):
    """Another number is typed at the verification press."""

    def force_n(self, step: PressStep) -> float:
        return step.force_n * (3 if step.presses == 1 else 1)


def test_a_k_that_its_verification_refutes_is_not_put_into_force(tmp_path: Path) -> None:
    with biotac.open(f"sim:{write_patient_scenario(tmp_path)}?pace={PACE}") as hand:
        hand.link.source = None
        (found,) = calibrate(hand, Wrong(), fingers=(0,), made_s=77)
        assert "% off on the verification press" in found.why_not and hand.board.calibration(0) is None


def test_what_was_pressed_is_not_lost_when_the_board_cannot_keep_it(tmp_path: Path, capsys, monkeypatch) -> None:
    def refuse(self: object) -> None:
        raise biotac.CommandRefusedError("SaveSettings: NOT_STORED", 10)

    monkeypatch.setattr("biotac.hand.configuration.Configuration.save_settings", refuse)  # no sim: port refuses it
    port = "sim:fingers.toml?fingers=1&pace=fast"
    assert main(["calibrate", "press", port, "--pressure", "--save", "--out", str(tmp_path)]) == 7
    output = capsys.readouterr()
    assert "NOT_STORED" in output.err and "in force until the next reboot" in output.out
    assert file.load(tmp_path / "finger0.json").pressure_gain_nn > 10_000_000


def test_files_that_are_there_are_seen_before_anybody_presses(tmp_path: Path, capsys) -> None:
    (tmp_path / "finger3.json").write_text("mine")
    assert main(["calibrate", "press", "sim:fingers.toml?pace=fast", "--pressure", "--out", str(tmp_path)]) == 2
    assert "finger3.json already exists" in capsys.readouterr().err
    assert (tmp_path / "finger3.json").read_text() == "mine" and len(list(tmp_path.iterdir())) == 1


def test_a_sensor_that_is_not_there_is_said_at_once() -> None:
    with (
        biotac.open("sim:fingers.toml?fingers=2") as hand,
        pytest.raises(biotac.InputError, match=r"no sensor on finger 3 \(0, 1 are there\)"),
    ):
        calibrate(hand, Silent(), fingers=(0, 3), made_s=0)


def test_a_source_that_ends_too_early_says_what_is_missing() -> None:
    with (
        biotac.open("sim:fingers.toml?fingers=1&seconds=9") as hand,
        pytest.raises(biotac.InputError, match=r"finger 0, \d+ rows: press 3 of 3 has no plateau"),
    ):
        calibrate(hand, Silent(), fingers=(0,), made_s=0)


# ---- recordings ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two fingers through all presses, recorded, and the plate beside it."""
    folder = tmp_path_factory.mktemp("pressed")
    steps = [
        *navarro.presses([0, 1], CALIBRATION_FORCES_N, ["E17"] * 3),
        *navarro.presses([0, 1], VERIFICATION_FORCES_N, ["E17"]),
    ]
    (folder / "two.toml").write_text(navarro.scenario("two", [11, 12], "worn", steps))
    with biotac.open(f"sim:{folder / 'two.toml'}") as hand:
        hand.record(folder / "two.mcap")
        hand.read_batch(1000)
    source = load_source(folder / "two.toml")
    assert source.truth is not None
    with (folder / "plate.csv").open("w", newline="") as out:
        writer = csv.writer(out)
        writer.writerow(["t_s", "fx_n", "fy_n", "fz_n"])
        first_us = int(Recording(folder / "two.mcap").frames["t_us"][0])
        for k, force in enumerate(source.truth.force_n.sum(axis=1)):  # one plate for both
            writer.writerow([(first_us + 10_000 * k) / 1e6, *force])
    return folder


def run(pressed: Path, *options: str) -> int:
    return main(["calibrate", "press", str(pressed / "two.mcap"), "--pressure", *options])


def test_a_recording_with_a_plate(pressed: Path, tmp_path: Path, capsys) -> None:
    assert run(pressed, str(pressed / "plate.csv"), "--json", "--out", str(tmp_path)) == 0
    (zero, first) = json.loads(capsys.readouterr().out)["fingers"]
    for facts, seed in ((zero, 11), (first, 12)):
        assert -K_LOW <= facts["gain_n"] / gain_at_e17(seed) - 1 <= K_HIGH
        assert facts["verification"]["board_error"] <= 0.059
        assert abs(facts["alignment"]["offset_s"]) <= 0.02 and facts["alignment"]["peak"] > 0.9
    assert file.load(tmp_path / "two-finger1.json").serial == "BTSIM00000000012"


def test_a_recording_with_a_scale_that_was_read(pressed: Path, capsys) -> None:
    typed = ",".join(f"{force:g}" for force in FORCES)
    assert run(pressed, "--readings", typed, "--finger", "1", "--json") == 0
    (finger,) = json.loads(capsys.readouterr().out)["fingers"]
    assert finger["finger"] == 1 and finger["verification"]["board_error"] <= 0.059
    assert run(pressed, "--readings", typed) == 0
    table = capsys.readouterr().out.splitlines()
    assert len(table) == 3 and "BTSIM00000000011" in table[1]


def test_readings_in_kilograms_are_refused_and_written_only_by_force(pressed: Path, tmp_path: Path, capsys) -> None:
    kilograms = ",".join(f"{force / 9.80665:.3f}" for force in FORCES)
    argv = ["--finger", "1", "--out", str(tmp_path / "out"), "--readings"]
    assert run(pressed, *argv, kilograms) == 1
    assert "--unit kg" in capsys.readouterr().out and not (tmp_path / "out").exists()
    assert run(pressed, *argv, kilograms, "--unit", "kg") == 0
    assert run(pressed, "--readings", "2,3.5,5") == 2 and "3 forces given, expected 4" in capsys.readouterr().err
    assert run(pressed, *argv, "2,3.5,5,16", "--force") == 0
    provenance = json.loads((tmp_path / "out" / "two-finger1.json").read_text())["provenance"]
    assert "75% off on the verification press" in provenance["not_worth_using"]


@pytest.mark.parametrize("head", ["t_s,force_n", "time [s],Fx [N],Fy [N],Fz [N],Tx [Nm],Ty [Nm],Tz [Nm]"])
def test_a_plate_by_another_clock_gives_the_same_k(pressed: Path, tmp_path: Path, capsys, head: str) -> None:
    """Or the size alone, or the file of a wrench calibration."""
    values = np.loadtxt(pressed / "plate.csv", delimiter=",", skiprows=1)
    late, size = values[:, :1] + 1e4, np.linalg.norm(values[:, 1:], axis=1)
    columns = [late, size] if "force" in head else [late, values[:, 1:], np.ones((len(late), 3))]
    np.savetxt(tmp_path / "late.csv", np.column_stack(columns), delimiter=",", header=head, comments="")
    found = []
    for path in (pressed / "plate.csv", tmp_path / "late.csv"):
        assert run(pressed, str(path), "--json") == 0
        found.append(json.loads(capsys.readouterr().out)["fingers"])
    for own, other in zip(*found, strict=True):
        assert other["gain_n"] == pytest.approx(own["gain_n"], rel=1e-6)
        assert other["alignment"]["offset_s"] - own["alignment"]["offset_s"] == pytest.approx(1e4, abs=1e-3)


def noisy(values: np.ndarray) -> np.ndarray:
    force = np.random.default_rng(1).normal(0, 1, values[:, 1:].shape)
    return np.column_stack([values[:, 0], force])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda v: v * [1, 20, 20, 20], "N/count, expected 0.0009 to 0.1; is the reference in newtons, and"),
        (noisy, "their changes correlate with 0."),
        (lambda v: v[:900], "9.0 s of force or counts: expected at least 10 s to align them"),
        (lambda v: v[:1500], "has no reference: it gave no force in "),
        (None, "'t_ms' is in 'ms': expected t in s"),
    ],
)
def test_a_reference_that_is_none_is_refused_with_its_number(
    pressed: Path, tmp_path: Path, capsys, change: Callable[[np.ndarray], np.ndarray] | None, message: str
) -> None:
    with (pressed / "plate.csv").open(newline="") as f:
        head, *rows = list(csv.reader(f))
    path, values = tmp_path / "changed.csv", np.array(rows, np.float64)
    with path.open("w", newline="") as out:
        csv.writer(out).writerows([head, *change(values).tolist()] if change else [["t_ms", *head[1:]], *rows])
    assert run(pressed, str(path), "--out", str(tmp_path / "out")) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_gain_of_a_file_recomputes_a_recording(pressed: Path, tmp_path: Path) -> None:
    """With the recorded tares kept, and through the whole machine: the same forces."""
    (tmp_path / "gain.json").write_text(json.dumps({"pressure_gain_nn": 10_500_000}))
    for name, options in (("kept", ["--keep-tare"]), ("run", [])):
        out = tmp_path / f"{name}.mcap"
        settings = str(tmp_path / "gain.json")
        assert (
            main(["export", "--recompute", str(pressed / "two.mcap"), str(out), "--settings", settings, *options]) == 0
        )
    kept, ran = (Recording(tmp_path / f"{name}.mcap") for name in ("kept", "run"))
    loudest = max(SimFinger(seed).pressure_gain for seed in (11, 12))
    assert np.nanmax(kept.frames["pressure_force_n"]) == pytest.approx(5.0 * loudest, rel=0.02)
    np.testing.assert_array_equal(kept.frames["pressure_force_n"], ran.frames["pressure_force_n"])
    np.testing.assert_array_equal(kept.frames["pdc_filtered"], ran.frames["pdc_filtered"])
    assert main(["check", str(tmp_path / "run.mcap")]) == 0
