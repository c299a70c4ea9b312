"""The whole chain: the demo's files and the facts that it states."""

import json
from pathlib import Path

import numpy as np
import pytest

import biotac
from biotac.cli.main import main
from biotac.demo.run import DemoRun, expected_frames, run_demo
from biotac.recording.crosscheck import POC_BOUND_UM
from biotac.recording.felt import Felt
from biotac.sim.loading import load_source


def quiet(text: str) -> None:
    """No progress line in tests."""


@pytest.fixture(scope="module")
def pressed(tmp_path_factory: pytest.TempPathFactory) -> tuple[DemoRun, Path]:
    """press.toml, and the folder that the demo left."""
    folder = tmp_path_factory.mktemp("demo")
    return run_demo("press.toml", folder, show=quiet), folder


@pytest.mark.nightly  # calibrates a finger
def test_a_demo_leaves_recording_report_and_picture_and_says_what_was_felt(pressed, tmp_path, capsys) -> None:
    demo, folder = pressed
    assert demo.good
    assert (folder / "demo.png").read_bytes().startswith(b"\x89PNG")
    assert len(biotac.load(folder / "demo.mcap")) == demo.facts["frames"]
    assert json.loads((folder / "report.json").read_text())["crosscheck"]["violations"] == 0
    own, lin = (demo.facts["felt"][name] for name in ("own wrench map", "Lin's scales"))
    # With loads that it was not made of. In the band of 5 N, one press at one place, both are off by 1.1 N, the map
    # along x and Lin's along z, and by how much each time depends on when the walk's tare was taken.
    for ours, theirs in zip(own[:-1], lin[:-1], strict=True):
        assert ours["applied_n"] == theirs["applied_n"]
        assert np.linalg.norm(ours["rmse_n"]) < np.linalg.norm(theirs["rmse_n"])
    assert np.linalg.norm(own[-1]["rmse_n"]) < own[-1]["from_n"] / 4
    frames = np.array([[band["frames"]] for band in own])
    whole_n = [np.sqrt((frames * np.square([band["rmse_n"] for band in bands])).sum()) for bands in (own, lin)]
    assert whole_n[0] < whole_n[1] / 2
    assert [band["from_n"] for band in own] == [0.5, 1.0, 2.0, 5.0]
    assert main(["demo", "sim:press.toml", "--out", str(tmp_path)]) == 0  # as `biotac list` prints it
    lines = [line.split() for line in capsys.readouterr().out.splitlines()[-6:]]
    assert lines[0] == ["calibrated", "not", "calibrated", "Lin", "2013"]
    assert lines[1] == ["applied,", "N", *["read", "error"] * 3] and [len(line) for line in lines[2:]] == [7] * 4
    kept, felt = biotac.Recording(folder / "demo.mcap"), Felt()
    felt.add(kept.applied_n, kept.frames["force_n"])  # one of the picture's curves
    ours, shown = (bands[2]["felt_n"] for bands in (felt.bands, demo.facts["felt"]["population map"]))
    assert ours == pytest.approx(shown, rel=0.01)


@pytest.mark.nightly
def test_presses_are_seen_and_released(pressed) -> None:
    demo, _ = pressed
    truth = demo.source.truth
    assert truth is not None
    frames = demo.batch.frames
    contact = (frames["flags"] & biotac.FrameFlags.CONTACT) != 0
    firm = np.linalg.norm(truth.force_n[:, 0], axis=1) > 2.0
    touched = truth.contact[:, 0]
    # A contact needs three frames to be believed, a release ten or more.
    assert contact[firm].mean() > 0.97
    assert not contact[:100].any()
    assert contact[~touched].mean() < 0.25
    reasons = [t["reason"] for t in demo.facts["tare_changes"]]
    assert reasons.count("ROLL_BACK") == reasons.count("RELEASE") + reasons.count("RESIDUE") == 3


@pytest.mark.nightly
def test_five_fingers_with_pac_lose_nothing(tmp_path) -> None:
    demo = run_demo("press.toml", tmp_path, fingers=5, seconds=20, show=quiet)
    facts = demo.facts
    assert demo.good
    assert facts["frames"] == facts["pac_blocks"] == 10_000
    assert facts["board_slots_late"] == facts["board_dropped"] == 0
    for finger in range(5):
        own = demo.batch.frames["finger"] == finger
        assert np.array_equal(demo.batch.frames["seq"][own], np.arange(2000))
        assert np.array_equal(demo.batch.frames["counts"][own], demo.source.samples[:, finger, 7::2])
        own = demo.batch.pac["finger"] == finger
        assert np.array_equal(demo.batch.pac["pac"][own], demo.source.samples[:, finger, 0::2])
    assert facts["crosscheck"]["poc_um_max"] <= POC_BOUND_UM
    assert facts["crosscheck"]["force_mn_max"] <= facts["crosscheck"]["force_mn_bound"]
    assert facts["crosscheck"]["torque_nmm_max"] <= facts["crosscheck"]["torque_nmm_bound"]


def test_a_finger_without_a_calibration_leaves_all_the_same(tmp_path, capsys) -> None:
    """Played counts that no emulated finger made: there is nothing to calibrate."""
    rows = load_source("press.toml", seconds=6).samples[:, 0]
    np.savez(tmp_path / "rows.npz", E=rows[:, 7::2], PDC=rows[:, 1], TAC=rows[:, 3], TDC=rows[:, 5])
    assert main(["demo", str(tmp_path / "rows.npz"), "--out", str(tmp_path), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["frames"], facts["frames_lost"], facts["felt"]) == (600, 0, {})
    assert facts["crosscheck"]["violations"] == 0 and facts["recording_matches"] is True
    assert json.loads((tmp_path / "report.json").read_text()) == facts
    assert (tmp_path / "demo.png").read_bytes().startswith(b"\x89PNG")
    assert len(biotac.load(tmp_path / "demo.mcap")) == 600


@pytest.mark.nightly
def test_a_biotac_sp_arrives_without_a_force(shared_data, tmp_path) -> None:
    """The board asks for the serial number, as of any unknown sensor, before it believes the answers."""
    name = shared_data / "btd_biotacsp/data.btd.gz"
    demo, source = run_demo(str(name), tmp_path, show=quiet), load_source(name)
    frames, rows = demo.batch.frames, source.samples[:, 0, 7::2]
    assert demo.good and len(rows) - 50 < len(frames) == len(rows) - demo.facts["rounds_unsampled"]
    played = map(bytes, rows)
    assert all(bytes(counts) in played for counts in frames["counts"]), (
        "each is the next, or after rows that were asked"
    )
    assert np.isnan(frames["force_n"]).all() and (frames["flags"] & biotac.FrameFlags.SENSOR_FAULT).all()


@pytest.mark.parametrize(
    "name", ["robotic_finger/trial_15330.npz", pytest.param("syntouchcontact/F1.npz", marks=pytest.mark.nightly)]
)
def test_every_recorded_row_arrives_in_order(shared_data, tmp_path, name: str) -> None:
    demo = run_demo(str(shared_data / name), tmp_path, show=quiet)
    source = load_source(shared_data / name)
    assert demo.good
    assert len(demo.batch.frames) == expected_frames(source) == len(source.samples)
    assert np.array_equal(demo.batch.frames["seq"], np.arange(len(source.samples)))
    assert np.array_equal(demo.batch.frames["counts"], source.samples[:, 0, 7::2])
    check = demo.facts["crosscheck"]
    assert check["frames"] == len(source.samples)
    assert check["poc_um_max"] <= 1.2
    assert check["force_mn_max"] <= check["force_mn_bound"]
    assert check["torque_nmm_max"] <= check["torque_nmm_bound"]


@pytest.mark.nightly
def test_real_presses_are_released(shared_data, tmp_path) -> None:
    """Skin keeps signal and pressure after a press; a tare that only returns to the old value locks out."""
    demo = run_demo(str(shared_data / "robotic_finger/trial_15330.npz"), tmp_path, show=quiet)
    reasons = [t["reason"] for t in demo.facts["tare_changes"]]
    assert reasons.count("RELEASE") + reasons.count("RESIDUE") >= 10
    tared = (demo.batch.frames["flags"] & biotac.FrameFlags.TARE_CHANGED) != 0
    rest_pdc = np.median(demo.batch.frames["pdc"][:600].astype(float))
    rezeroed = demo.batch.wire["tare_state"] == 1
    assert demo.batch.frames["pdc"][tared & rezeroed].max() <= rest_pdc + 60
