"""The population map: at rest and mirrored, after a few presses, and the accuracy reached on real fingers."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import wrench_run

from biotac.calibrate import population as population_map
from biotac.calibrate.population import Population, Trained
from biotac.calibrate.press import known_force
from biotac.calibrate.press.few_shot import PLATE, Scale, scale_of, shrink_to
from biotac.calibrate.press.known_force import Held, angles_deg, of_plate
from biotac.calibrate.wrench.plate_recording import Run, load_run
from biotac.cli.main import main as gateway
from biotac.core import geometry as surface
from biotac.errors import InputError
from biotac.map import columns
from biotac.map.bound import summary
from biotac.map.columns import Signals
from biotac.map.population import likeness
from biotac_lab.calibrate import held_out_error, training
from biotac_lab.calibrate.peer_net import PeerNet
from biotac_lab.cli import main


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Three synthetic fingers."""
    folder = tmp_path_factory.mktemp("fingers")
    return [wrench_run.save(folder / f"{seed}.npz", wrench_run.fields(4000, seed)) for seed in (1, 2, 3)]


@pytest.fixture(scope="module")
def runs(files: list[Path]) -> list[Run]:
    return [load_run(path) for path in files]


@pytest.fixture(scope="module")
def fingers(runs: list[Run]) -> list[training.FingerSums]:
    return [training.sums_of(run) for run in runs]


@pytest.fixture(scope="module")
def prior(fingers: list[training.FingerSums]) -> Population:
    return training.train(fingers[:2])


def test_an_electrodes_mirror_image_lies_across_and_is_mirrored_back() -> None:
    at = np.asarray(surface.ELECTRODE_MM)
    assert np.allclose(at[training.MIRROR], at * [1.0, -1.0, 1.0], atol=0.01)
    assert np.array_equal(training.MIRROR[training.MIRROR], np.arange(19))


def test_rest_is_no_force_on_any_finger(prior: Population, runs: list[Run]) -> None:
    for run in runs:
        assert np.array_equal(prior.force(run.tare[None], run.tare), np.zeros((1, 3)))


def test_a_symmetric_map_says_the_mirrored_force_of_a_mirrored_finger(
    fingers: list[training.FingerSums], runs: list[Run]
) -> None:
    prior = training.train(fingers[:2], symmetric=True)
    other = training.mirrored(runs[2])
    mirrored = prior.force(other.counts, other.tare)
    assert np.allclose(mirrored, prior.force(runs[2].counts, runs[2].tare) * [1.0, -1.0, 1.0], atol=1e-6)


def test_a_new_finger_is_told_better_than_by_lins_scales_of_the_others(prior: Population, runs: list[Run]) -> None:
    def lin(run: Run) -> np.ndarray:
        return (run.counts - run.tare) @ surface.ELECTRODE_NORMAL

    felt_n = np.concatenate([lin(run) for run in runs[:2]])
    truth = np.concatenate([run.truth for run in runs[:2]])
    scales = (felt_n * truth).sum(axis=0) / (felt_n**2).sum(axis=0)
    new = runs[2]
    lins = np.sqrt(((lin(new) * scales - new.truth) ** 2).mean(axis=0))
    found = np.sqrt(((prior.force(new.counts, new.tare) - new.truth) ** 2).mean(axis=0))
    assert (found < 0.8 * lins).all()  # these fingers are linear, which real ones are not in a light touch


def test_the_map_is_one_for_a_board(prior: Population, runs: list[Run]) -> None:
    new = runs[2]
    of_board = prior.wrench_map(new.tare)
    assert np.allclose(of_board.predict(new.counts), prior.force(new.counts, new.tare), atol=1e-9)
    assert summary(of_board, new.counts)["outside"] == 0


def test_five_presses_find_a_finger_that_is_softer_and_tilted() -> None:
    felt_n = np.column_stack([np.zeros(20), np.zeros(20), np.full(20, 40.0)])
    felt_n[:, 0] = 0.1 * felt_n[:, 2]
    found = scale_of(felt_n, felt_n * [0.0, 0.0, 1.2])
    assert found.gain == pytest.approx(1.2, abs=0.001)
    assert found.balance == pytest.approx(0.1, abs=0.001)
    # light ones say less than the prior of fingers
    light = scale_of(0.01 * felt_n, felt_n * [0.0, 0.0, 0.012])
    assert 1.0 < light.gain < 1.02
    assert 0.0 < light.balance < 0.05
    assert np.allclose(
        Scale(1.2, 0.1).applied(felt_n), np.column_stack([np.zeros(20), np.zeros(20), np.full(20, 48.0)])
    )


@pytest.mark.parametrize(("said_z", "shown"), [([1.0, -2.0, 3.0], [1.0, 2.0, 3.0]), ([1.0, 2.0, 3.0], [0, 2, 3])])
def test_presses_that_say_nothing_are_refused(said_z: list[float], shown: list[float]) -> None:
    felt_n = np.column_stack([np.zeros(len(said_z)), np.zeros(len(said_z)), said_z])
    with pytest.raises(InputError, match="presses"):
        scale_of(felt_n, np.multiply.outer(shown, [0.0, 0.0, 1.0]))


def test_a_run_against_the_others_is_named_and_not_a_scale(prior: Population, runs: list[Run]) -> None:
    flipped = replace(prior, coefficients=-prior.coefficients)
    with pytest.raises(InputError, match=r"^3\.npz: the map of the others feels -\d.* along z"):
        held_out_error.worth(flipped, runs[2])


def test_a_minute_moves_the_map_and_no_time_does_not(prior: Population, runs: list[Run]) -> None:
    new = runs[2]
    sums = training.sums(new)
    assert np.array_equal(shrink_to(prior, sums, 0.0).coefficients, prior.coefficients)
    rmse = [
        float(((shrink_to(prior, sums, seconds).force(new.counts, new.tare) - new.truth) ** 2).sum())
        for seconds in (0.0, 60.0, 6000.0)
    ]
    assert rmse[0] > rmse[1] > rmse[2]


def test_what_goes_with_f_z_in_a_recording_is_its_mounting(runs: list[Run]) -> None:
    """A plate tilted about y turns some of F_z into F_x in the whole recording, and leaves the map unchanged."""
    run = runs[0]
    tilted = run.truth.copy()
    tilted[:, 0] += 0.1 * tilted[:, 2]
    level, other = (training.train([training.sums_of(one)]) for one in (run, replace(run, truth=tilted)))
    assert np.allclose(level.coefficients, other.coefficients, atol=1e-6)


@pytest.mark.nightly  # trains three times; by day each part of it
def test_the_command_trains_judges_and_keeps(
    files: list[Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "population.json"
    shared = tmp_path / "2.npz"
    words = ["--share", str(shared), "--plate", "made up", "--licence", "CC0-1.0"]
    assert (
        gateway(["calibrate", "wrench", str(files[1]), "--as-recorded", *words]) == 0
        and gateway(["check", str(shared)]) == 0
    )
    capsys.readouterr()
    arguments = ["population", str(files[0]), str(shared), "--test", str(files[2]), "--json"]
    assert main([*arguments, "--out", str(out), "--source", "made up"]) == 0
    facts = json.loads(capsys.readouterr().out)
    for field in ("rmse_n", "rmse_scale5_n", "sigma_n", "sigma_scale5_n"):
        assert len(facts[field]) == 3
    assert facts["rmse_60s_n"] is None  # a recording of 40 s has no minute to fit and rest to judge
    assert 0.0 < facts["coverage"][0] < facts["coverage"][1] <= 1.0
    trained = population_map.load(out)
    assert trained.provenance["source"] == "made up"
    assert list(trained.provenance["files"]) == ["1.npz", "2.npz"]
    assert population_map.dumps(trained) == out.read_text(encoding="utf-8")
    assert main([*arguments, "--out", str(out)]) != 0
    assert "exists" in capsys.readouterr().err
    assert main(["population", str(files[0]), "--test", str(files[0])]) != 0
    assert "both a training file and --test" in capsys.readouterr().err


@pytest.mark.parametrize("damage", [("biotac-population-map/1", "/2"), ("COMPRESSION", "BULGE")])
def test_a_damaged_file_is_refused_in_words(prior: Population, damage: tuple[str, str], tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    path.write_text(population_map.dumps(Trained(prior, np.ones(3), np.ones(3), {})).replace(*damage))
    with pytest.raises(InputError, match="biotac-lab population --out"):
        population_map.load(path)


def test_a_finger_is_pulled_to_others_and_not_to_itself(prior: Population, runs: list[Run], files: list[Path]) -> None:
    trained = Trained(prior, np.ones(3), np.ones(3), population_map.provenance_of(files[:2], "", symmetric=False))
    others, note = trained.others_than([files[2]])
    assert others is not None and note == "regularized towards the population map of 1.npz, 2.npz"
    e = runs[2].counts[:50] - runs[2].tare
    z = columns.with_one(columns.columns(Signals(e, runs[2].tare)))
    assert z @ others == pytest.approx(prior.force(runs[2].counts[:50], runs[2].tare), abs=1e-9)
    others, note = trained.others_than([files[0]])
    assert others is None and note.startswith(
        "not regularized towards the population map of 1.npz, 2.npz, which was made"
    )


def test_fingers_of_the_training_agree_with_the_normals_and_a_poke_does_not(
    prior: training.Population, runs: list[Run]
) -> None:
    def share(counts: np.ndarray, tare: np.ndarray) -> np.ndarray:
        force_100un = np.rint(1e4 * prior.force(counts, tare)).astype(np.int64)
        return likeness(counts - tare, force_100un).share

    poke = runs[0].tare - 900.0 * np.eye(19)
    assert np.mean(share(runs[0].counts, runs[0].tare) > 0) > np.mean(share(poke, runs[0].tare) > 0) == 0.0


def contact_of_another_rig(shared_data: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Counts (n, 19), tare, and minus the plate's normal (n, 3), where a plate presses a finger of another rig."""
    fields = np.load(shared_data / "robotic_finger/trial_15330.npz")
    rest = slice(400)  # nothing touches it
    tare, pdc = np.median(fields["E"][rest], axis=0), np.median(fields["PDC"][rest])
    touched = fields["PDC"] > pdc + 40
    return fields["E"][touched], tare, (fields["z_dir"] * [1.0, -1.0, 1.0])[touched]


def test_a_plate_pressed_by_hand_corrects_the_sides_of_a_finger_of_another_rig(shared_data: Path) -> None:
    """Fitted without force and normal to the first half of the trial, tested on the other."""
    counts, tare, into = contact_of_another_rig(shared_data)
    half = len(counts) // 2
    press = np.arange(half) // 50
    held = Held(counts[:half].astype(np.float64), tare, press, np.zeros((press[-1] + 1, 3)))
    trained = population_map.load(None)
    found = known_force.found(trained.population, of_plate(held, trained.population), PLATE)
    own = found.own.wrench_map(tare).on_board()
    new = counts[half:]
    tare_q4 = np.tile((16 * tare).astype(np.uint16), (len(new), 1))
    force = own.results(new, tare_q4, np.zeros(len(new), np.int32))[0]
    off = angles_deg(force, into[half:])
    side = np.abs(into[half:, 1]) > 0.3
    assert np.median(off) <= 9.0 and np.percentile(off, 90) <= 15.0
    assert np.mean(force[side, 1] * into[half:][side, 1] > 0.0) >= 0.99
    assert found.held_out_deg < found.before_deg and not found.why_not(trained.sigma_scale5_n)


def test_a_plate_on_one_side_is_refused() -> None:
    pressed = np.tile(2800.0 - 200.0 * np.eye(19)[:3], (2, 1))
    held = Held(pressed, np.full(19, 2800.0), np.arange(6), np.zeros((6, 3)))
    with pytest.raises(InputError, match="both sides"):
        of_plate(held, population_map.load(None).population)


def test_the_default_force_holds_on_other_rigs(shared_data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """F1 and F2 are all that the map is trained on: a plate on another rig's finger, and two that hold a tool."""
    files = [shared_data / "robotic_finger/trial_15330.npz", shared_data / "usc_pinch/pinch_2017.npz"]
    assert main(["direction", *map(str, files), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    rows = [dict(zip(facts["head"], row, strict=True)) for row in facts["rows"]]
    plate, *pinches = [row for row in rows if row["by"] == "default"]
    assert plate["median deg"] <= 12.0 and plate["p90"] <= 22.0
    assert plate["y sign right"] >= 0.95 and plate["y corr."] >= 0.8 and plate["x sign right"] >= 0.95
    assert plate["wrong"] == 0 or plate["wrong flagged"] >= 0.8
    assert plate["others flagged"] <= 0.15
    assert len(pinches) == 2 and all(row["pulls"] == 0.0 for row in (plate, *pinches))


def test_a_net_of_another_size_is_refused_and_one_of_theirs_gives_forces(tmp_path: Path) -> None:
    path = tmp_path / "model.ckpt.data-00000-of-00001"
    path.write_bytes(np.random.default_rng(1).normal(0.0, 0.1, 1151024 // 4).astype("<f4").tobytes())
    e = np.random.default_rng(2).normal(0.0, 100.0, (5, 19))
    force_n = PeerNet(path).force_n(e)
    assert force_n.shape == (5, 3) and np.isfinite(force_n).all() and np.ptp(force_n, axis=0).min() > 0.0
    path.write_bytes(bytes(400))
    with pytest.raises(InputError, match="400 bytes: expected a net of biotac_force_net"):
        PeerNet(path)


@pytest.mark.nightly
def test_real_fingers_each_by_the_other(shared_data: Path) -> None:
    """A tenth above the error reached when direction across rigs was no goal (population.md)."""
    runs = [training.aligned(load_run(shared_data / "syntouchcontact" / name)) for name in ("F1.npz", "F2.npz")]
    fingers = [training.sums_of(run) for run in runs]
    within, after_presses = [], []
    for k, new in ((0, runs[1]), (1, runs[0])):
        image = held_out_error.worth(training.train([fingers[k]], mirror=False), training.mirrored(runs[k]))
        sigma = held_out_error.sigma_of([image])
        facts = held_out_error.facts(held_out_error.worth(training.train([fingers[k]]), new), sigma)
        within.append(facts["coverage"])
        after_presses.append(facts["coverage_scale5"])
        assert (np.array(facts["rmse_n"]) <= [0.60, 0.388, 0.46]).all()
        assert (np.array(facts["rmse_scale5_n"]) <= [0.51, 0.388, 0.47]).all()
        # without products of conductances a minute helps F1's x less: 0.49 in place of 0.43
        assert (np.array(facts["rmse_60s_n"]) <= [0.50, 0.41, 0.47]).all()
    for one, two in (np.mean(within, axis=0), np.mean(after_presses, axis=0)):
        assert 0.55 <= one <= 0.80 and 0.90 <= two <= 0.99
