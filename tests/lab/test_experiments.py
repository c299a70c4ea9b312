"""The papers' experiments: closed forms, recordings, and that table, JSON and exit code say the same."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import biotac
from biotac.calibrate.wrench import contact
from biotac.core import geometry as surface
from biotac.errors import InputError, RecordingError
from biotac.map import columns
from biotac.map.columns import Signals
from biotac.map.fitted import WrenchMap
from biotac.wire import messages_gen as wire
from biotac_lab.cli import main
from biotac_lab.experiments import estimates, laboratory, plate_normal, poke, shear, torsion_shear
from biotac_lab.experiments.estimates import Estimate
from biotac_lab.experiments.trial import Trial
from biotac_lab.report import Options, Table


@pytest.fixture(scope="module")
def figure10() -> Trial:
    return torsion_shear.replay(seed=3)


def recorded_axes(lin: np.ndarray) -> np.ndarray:
    """Lin's frame to X lateral, Y to the tip, Z out of the pad, by hand."""
    return np.column_stack([lin[:, 1], lin[:, 0], -lin[:, 2]])


def save(path: Path, trial: Trial, **more: np.ndarray) -> Path:
    """A trial as a laboratory would have it."""
    fields = {"E": trial.counts, "PDC": trial.pdc, "F": recorded_axes(trial.force_n)} | more
    np.savez(path, **{name: values for name, values in fields.items() if values is not None})
    return path


# ---- poke ----------------------------------------------------------------------------------------


def test_spread_of_points_that_are_known() -> None:
    # +-3 along x, +-4 along y, all four combinations eight times: std 3 and 4 but for n - 1, so 5 in length
    around = np.array([[3.0, 4.0, 0.0], [3.0, -4.0, 0.0], [-3.0, 4.0, 0.0], [-3.0, -4.0, 0.0]] * 8)
    points = np.concatenate([around + poke.TRUE_MM[0] + [0.0, 0.0, 2.0], np.full((3, 3), np.nan)])
    rows = np.ones(len(points), dtype=bool)
    known = poke.spread(points, [rows])
    assert known.frames == [32]
    assert known.std_mm[0] == pytest.approx(5.0 * np.sqrt(32 / 31))
    assert known.axis_std_mm[0] == pytest.approx(5.0 * np.sqrt(32 / 31) / np.sqrt(3))
    assert known.bias_mm[0] == pytest.approx(2.0)
    few = poke.spread(points[: poke.MIN_FRAMES - 1], [rows[: poke.MIN_FRAMES - 1]])
    assert np.isnan(few.std_mm[0]) and np.isnan(few.bias_mm[0])


def test_a_recorded_poke_has_the_figures_of_the_emulated_one(tmp_path: Path) -> None:
    trial = poke.emulated(2, "new")
    theirs = poke.measure(Options(recording=save(tmp_path / "poke.npz", trial)))
    for case in theirs.cases:
        points = trial.again({wire.Setting.POC_WEIGHTS: int(case.weights)}).frames["poc_mm"]
        own = poke.spread(points, poke.contacts(trial))
        assert (case.trials[0].std_mm == own.std_mm).all()
        assert (case.trials[0].bias_mm == own.bias_mm).all()


def test_a_recording_with_another_number_of_contacts_is_refused(tmp_path: Path) -> None:
    trial = poke.emulated(1, "new")
    force = trial.force_n.copy()
    force[trial.time_s < trial.phases[2].end_s] = 0.0
    path = save(tmp_path / "poke.npz", replace(trial, force_n=force))
    with pytest.raises(RecordingError, match="18 contacts above 1 N: expected 19"):
        poke.run(Options(recording=path))


# ---- plate-normal --------------------------------------------------------------------------------


def test_angles_that_are_known() -> None:
    below = np.array([[-5.0, 0.0, -surface.RADIUS_MM]] * 3 + [[np.nan] * 3])
    tilt = np.radians([0.0, 12.5, 170.0, 0.0])
    normals = np.column_stack([np.sin(tilt), np.zeros(4), -np.cos(tilt)])
    found = plate_normal.angles_deg(below, normals)
    assert found[:3] == pytest.approx([0.0, 12.5, 170.0])
    assert np.isnan(found[3])


def test_a_frame_without_a_point_counts_against_the_weights() -> None:
    touched, pressure = np.array([True, True, False]), np.array([50.0, 50.0, 50.0])
    result = plate_normal.Angles("new", poke.SHIPPED, np.array([5.0, np.nan, 90.0]), touched, pressure)
    assert result.over(40.0).tolist() == [5.0, 180.0]
    assert result.over(50.0).tolist() == []


@pytest.mark.nightly
def test_a_recorded_plate_has_the_figures_of_the_emulated_one(tmp_path: Path) -> None:
    trial = plate_normal.emulated(4, "new")
    lin = surface.normals_at(np.where(np.isfinite(trial.at_mm), trial.at_mm, [0.0, 0.0, -1.0]))
    path = save(tmp_path / "plate.npz", trial, z_dir=np.column_stack([-lin[:, 0], lin[:, 1], -lin[:, 2]]))
    theirs = plate_normal.run(Options(recording=path)).tables
    own = plate_normal.run(Options(seed=4)).tables
    for found, other in zip(theirs, own, strict=True):
        rows = [row for row in other.facts()["rows"] if row[0] == "new"]
        assert [row[1:] for row in found.facts()["rows"]] == [row[1:] for row in rows]


def test_the_real_plate(shared_data: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = shared_data / "robotic_finger" / "trial_15330.npz"
    assert main(["experiment", "plate-normal", str(path), "--json", "--check"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [check["limit"] for check in facts["checks"]] == [8.9, 14.7]
    median, p90 = (check["seen"] for check in facts["checks"])
    assert median <= 8.9 and p90 <= 14.7
    # a correction by the other contacts leaves less than half: the error is the formula's
    *_, corrected_median, _, corrected_p90 = facts["tables"][0]["rows"][-1]
    assert corrected_median < 4.0
    assert corrected_p90 < 11.0


# ---- the weight: figures 3, 9 and 10 -------------------------------------------------------------


def test_torsion_is_what_turned_the_contact() -> None:
    rng = np.random.default_rng(1)
    at = surface.on_surface(np.column_stack([rng.uniform(-12, 3, 50), rng.uniform(-3, 3, 50)]))
    force, turned = rng.normal(0.0, 3.0, (50, 3)), rng.normal(0.0, 5.0, 50)
    assert estimates.torsion(force, contact.moment(at, force, turned), at) == pytest.approx(turned)
    assert np.isnan(estimates.torsion(force, force, np.full((50, 3), np.nan))).all()


def test_a_finger_that_is_as_the_paper_says_is_measured_by_its_scales(figure10: Trial) -> None:
    known = np.isfinite(figure10.signal).all(axis=1)
    sums = np.nan_to_num(figure10.signal) @ surface.ELECTRODE_NORMAL
    arms = np.cross(surface.ELECTRODE_MM, surface.ELECTRODE_NORMAL)
    force = sums * [1.5e-3, 2.5e-4, 5e-4]
    torque = (np.nan_to_num(figure10.signal) @ arms) * [0.0, 7e-4, 3e-4]
    trial = replace(figure10, force_n=force, torque_nmm=torque)
    scales = estimates.paper_scales([trial])
    assert scales == {
        wire.Setting.FORCE_GAIN_X_NN: 1_500_000,
        wire.Setting.FORCE_GAIN_Y_NN: 250_000,
        wire.Setting.FORCE_GAIN_Z_NN: 500_000,
        wire.Setting.TORQUE_GAIN_Y_NN: 700_000,
        wire.Setting.TORQUE_GAIN_Z_NN: 300_000,
    }
    result = estimates.by_paper(trial, scales)
    assert np.abs(result.force_n - force)[known].max() < 2e-4  # the wire's last digit is 0.0001 N
    assert np.abs(result.torque_nmm - torque)[known][:, 1:].max() < 2e-3


def test_the_truth_has_the_right_signs_and_leaks_nothing(figure10: Trial) -> None:
    truth = Estimate("truth", figure10.force_n, figure10.torque_nmm)
    assert torsion_shear.signs(figure10, truth, figure10.at_mm) == {"I": True, "II": True, "III": True}
    assert torsion_shear.leakage(figure10, truth) == 0.0
    force = figure10.force_n + np.outer(0.125 * figure10.torsion_nmm, [0.0, 1.0, 0.0])
    assert torsion_shear.leakage(figure10, replace(truth, force_n=force)) == pytest.approx(0.125)
    pushed_up = figure10.force_n[:, 1] > 0.0
    turned = np.where(pushed_up[:, None], -1.0, 1.0) * figure10.torque_nmm
    wrong = torsion_shear.signs(figure10, Estimate("x", figure10.force_n * 0.0, turned), figure10.at_mm)
    assert wrong["I"] is False
    assert torsion_shear.signs(figure10, replace(truth, torque_nmm=None), figure10.at_mm) == {}


def test_a_map_is_given_the_board_s_tare_and_pressure(figure10: Trial) -> None:
    """And not the map's own tare, or a finger that has drifted since the calibration would be off by that."""
    axes = ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
    rows = columns.columns(Signals(figure10.signal, figure10.tare, figure10.pressure))
    coefficients = np.random.default_rng(1).normal(0.0, 1.0, (rows.shape[1] + 1, 6))
    result = WrenchMap("any", axes, np.full(19, 123.0), 1, (0,) * len(axes), coefficients)
    found = estimates.by_map(figure10, result, "any")
    expected = rows @ coefficients[:-1] + coefficients[-1]
    known = np.isfinite(expected).all(axis=1)
    assert known.sum() > 5000
    assert np.column_stack([found.force_n, found.torque_nmm])[known] == pytest.approx(expected[known])
    turned = replace(result, axes=("torsion", *axes[:5]))
    assert estimates.by_map(figure10, turned, "any").own_torsion_nmm[known] == pytest.approx(expected[known, 0])
    without_pressure = replace(figure10, pdc=np.full_like(figure10.pdc, wire.INVALID_COUNT))
    with pytest.raises(InputError, match="needs PDC"):
        estimates.by_map(without_pressure, result, "any")


def test_a_recorded_trial_has_the_figures_of_the_emulated_one(tmp_path: Path, figure10: Trial) -> None:
    path = save(tmp_path / "figure10.npz", figure10, M=recorded_axes(figure10.torque_nmm))
    theirs = torsion_shear.run(Options(recording=path)).tables[0].rows[0]
    own = torsion_shear.run(Options(seed=3)).tables[0].rows[0]
    # the plate's own contact and torsion, in closed form, are the scenario's
    assert theirs[1:] == pytest.approx(own[1:], abs=5e-5)


def test_errors_at_once_are_those_of_shear_with_torsion(figure10: Trial) -> None:
    off = figure10.force_n + np.where(figure10.torsion_nmm == 0.0, 100.0, -0.25)[:, None] * [0.0, 1.0, 0.0]
    torque = contact.moment(np.nan_to_num(figure10.at_mm, nan=-1.0), off, figure10.torsion_nmm + 0.5)
    assert torsion_shear.together(figure10, Estimate("off", off, torque)) == pytest.approx((0.25, 0.5))


def test_the_caption_of_figure_3_can_be_wrong() -> None:
    at = {"E1": 10.0, "E4": 10.0, "E11": 10.0, "E14": 10.0, "E17": -50.0}
    towards = {"E1": -90.0, "E4": -90.0, "E11": 90.0, "E14": 90.0, "E17": -50.0}
    away = {name: at[name] * 2 - value for name, value in towards.items()} | {"E17": -50.0}
    right = {"B": at, "C": towards, "D": at, "E": away, "F": at}
    assert [claim["met"] for claim in shear.claims(right)] == [True] * 4
    for phase, name, value, fails in (
        ("B", "E14", -1.0, {0}),
        ("F", "E17", 1.0, {1}),
        ("E", "E4", -20.0, {2, 3}),
        ("C", "E11", 5.0, {3}),
    ):
        wrong = right | {phase: right[phase] | {name: value}}
        assert {k for k, claim in enumerate(shear.claims(wrong)) if not claim["met"]} == fails


@pytest.mark.parametrize(
    ("field", "values", "words"),
    [
        ("M", None, "save M too"),
        ("M", np.zeros((7, 3)), r"field M is float64 \(7, 3\)"),
        ("t", np.r_[0:5299, 7.0], "field t goes back in row 5299"),
        ("z_dir", np.zeros((5300, 3)), "field z_dir has length 0 in row 0"),
    ],
)
def test_bad_fields_are_refused(tmp_path: Path, figure10: Trial, field: str, values, words: str) -> None:
    arrays = {"M": recorded_axes(figure10.torque_nmm)} | {field: values}
    with pytest.raises(RecordingError, match=words):
        laboratory.load(save(tmp_path / "bad.npz", figure10, **arrays), needs=("F", "M"))


# ---- the command ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["shear", *(pytest.param(name, marks=pytest.mark.nightly) for name in ("poke", "torsion"))]
)
def test_page_and_json_hold_the_same_figures(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    assert main(["experiment", name, "--out", str(tmp_path / "out"), "--seed", "7", "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    written = json.loads((tmp_path / "out" / f"{name}.json").read_text())
    assert {**written, "written": None} == {**printed, "written": None}
    page = (tmp_path / "out" / f"{name}.md").read_text()
    for table in written["tables"]:
        assert "| " + " | ".join(table["head"]) + " |" in page
    shown = [line.split("|")[1].strip() for line in page.splitlines() if line.startswith("| ")]
    assert {str(row[0]) for table in written["tables"] for row in table["rows"]} <= set(shown)
    assert (tmp_path / "out" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert f"({name}.png)" in page
    assert "emulated finger, seed 7" in page


def test_a_table_says_the_same_on_a_page_and_in_json() -> None:
    table = Table("t", ["a", "b"], [["x", 0.12345678], ["y", None], ["z", float("nan")], ["n", 3]], digits=2)
    assert table.facts()["rows"] == [["x", 0.1235], ["y", None], ["z", None], ["n", 3]]
    assert table.page()[4:8] == ["| x | 0.12 |", "| y | - |", "| z | - |", "| n | 3 |"]


def test_the_shipped_default_pokes_as_precisely_as_the_paper(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["experiment", "poke", "--check", "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [check["limit"] for check in facts["checks"]] == [0.23, 0.23, 0.36, 0.36]
    default = [row[3] for row in facts["tables"][0]["rows"] if row[1].endswith("(default)")]
    assert [check["seen"] for check in facts["checks"]] == default


def test_check_fails_with_its_own_code_when_a_figure_is_missed(monkeypatch, capsys: pytest.CaptureFixture[str]) -> None:
    report = shear.run(Options())
    assert all(check["met"] for check in report.checks)  # the emulated finger does as figure 3's caption says
    first, second, *_ = report.checks
    missed = replace(report, checks=[first | {"met": False}, second])
    monkeypatch.setattr(shear, "run", lambda options: missed)  # no emulated finger misses it
    assert main(["experiment", "shear"]) == 0
    assert main(["experiment", "shear", "--check"]) == 1
    output = capsys.readouterr().out
    assert f"* NOT met: {first['what']}" in output and f"* met: {second['what']}" in output


# ---- wettels2011 ---------------------------------------------------------------------------------


@pytest.mark.nightly
def test_wettels2011_runs_to_the_end_with_the_paper_s_filter(tmp_path: Path, capsys) -> None:
    assert main(["experiment", "wettels2011", "--quick", "--filter", "--out", str(tmp_path), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert [row["correct"] for row in facts["roc"]] and facts["bars"]["test"] == 30
    assert (tmp_path / "wettels2011.png").stat().st_size > 10_000


# ---- ways to fail --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def trials(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Recordings that lack data for the experiments."""
    folder = tmp_path_factory.mktemp("trials")
    with biotac.open("sim:press.toml?seconds=1") as hand:
        hand.record(folder / "rec.mcap")
        for _ in hand.batches():
            pass
    np.savez(folder / "rest.npz", E=np.full((300, 19), 3000), F=np.zeros((300, 3)), PDC=np.full(300, 2000))
    return folder


@pytest.mark.parametrize(
    ("words", "command"),
    [
        ("expected 0 to 2147483647", "poke --seed -1"),
        ("save z_dir too", "plate-normal @rec.mcap"),
        ("choose one with --finger", "poke @rec.mcap --finger thumb"),
        ("0 contacts above 1 N: expected 19", "poke @rest.npz --out @out"),
        ("save M too", "torsion @rest.npz"),
        ("force never exceeds 0.00 N", "shear @rest.npz"),
        ("drop one of them", "shear @rest.npz --seed 2"),
        ("does not use --map: drop it", "poke --map @no.wrench.json"),
        ("as `biotac calibrate wrench --out`", "shear --map @no.wrench.json"),
        ("rename the file", "shear --map @paper.wrench.json"),
        ("give --map FILE", "torsion-shear --check --out @out"),
        ("runs only on the emulated sensor", "navarro2015 @rest.npz"),
    ],
)
def test_each_way_to_fail_is_one_line_that_says_the_cure(trials: Path, words: str, command: str, capsys) -> None:
    assert main(["experiment", *command.replace("@", f"{trials}/").split()]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line
