"""A board's recording and an emulated Nano17's, joined by their own clocks: truth per row, and refused pairs."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import biotac
from biotac.calibrate.reference.mounting import Mounting
from biotac.calibrate.reference.nano17 import MOUNTING, Nano17
from biotac.calibrate.reference.samples import Reference, Samples
from biotac.calibrate.wrench.joined import BoardRows, board_of, choose_finger, join
from biotac.calibrate.wrench.plate_recording import load_run
from biotac.calibrate.wrench.share import share
from biotac.calibrate.wrench.sources import Loaded, check_serial
from biotac.cli.main import main
from biotac.clock.alignment import align
from biotac.core import geometry as surface
from biotac.errors import InputError, RecordingError
from biotac.recording.reader import Recording
from biotac.sim.source import Source

FROM_S, TO_S = 105.0, 175.0  # of calibrate.toml: the end of the rest, then a dozen places


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Recording, Source]:
    """The first three minutes of the calibration scenario, as a board recorded it."""
    path = tmp_path_factory.mktemp("joined") / "board.mcap"
    with biotac.open("sim:calibrate.toml") as hand:
        hand.record(path)
        hand.read(TO_S)
        source = hand.link.source
    assert source is not None
    return Recording(path), source


@pytest.fixture(scope="module")
def board(recorded: tuple[Recording, Source]) -> BoardRows:
    recording, _ = recorded
    board = board_of(recording.wire, recording.frames["t_us"], 0, "BTSIM00000000006")
    return board.only(board.t_s >= FROM_S)


@pytest.fixture(scope="module")
def reference(recorded: tuple[Recording, Source]) -> Reference:
    nano17 = Nano17()
    at_s, samples = nano17.measured(recorded[1], 0)
    until = at_s < TO_S + 5.0
    return Reference("nano17.csv", Samples(samples.t_s[until], samples.wrench[until]), nano17.mounting)


def truth_of(recorded: tuple[Recording, Source], board: BoardRows) -> np.ndarray:
    """Wrenches that the scenario applied in each of the board's frames (n, 7); the first is the source's first row."""
    recording, source = recorded
    assert source.truth is not None
    row = np.rint((board.t_s - recording.frames["t_us"][0] / 1e6) * 100.0).astype(np.int64)
    force, torque, poc = (
        values[row, 0] for values in (source.truth.force_n, source.truth.torque_nmm, source.truth.poc_mm)
    )
    touched = source.truth.contact[row, 0]
    torsion = np.zeros(len(row))
    about_poc = torque[touched] - np.cross(poc[touched], force[touched])
    torsion[touched] = (about_poc * surface.normals_at(poc[touched])).sum(axis=1)
    return np.column_stack([force, torque, torsion])


def test_the_truth_of_every_row(recorded: tuple[Recording, Source], board: BoardRows, reference: Reference) -> None:
    joined = join("board.mcap", board, reference)
    first_s = recorded[0].frames["t_us"][0] / 1e6
    # by the emulated clock: 417.3 s when the board's source begins, 60 ppm from then on
    expected_s = 417.3 + (joined.alignment.middle_s - first_s) * (1.0 + 60e-6) - joined.alignment.middle_s
    assert joined.alignment.offset_s == pytest.approx(expected_s, abs=0.002)
    assert joined.alignment.peak > 0.9
    assert joined.alignment.runner_up < 0.5
    np.testing.assert_allclose(joined.zero, Nano17().zero, atol=0.02)
    truth = truth_of(recorded, board)
    assert joined.run.axes[6:] == ("torsion",)
    error = joined.run.truth - truth[: len(joined.run.truth)]
    # a contact's corners are 0.2 s long; a millisecond off them is the uncertainty of the clocks
    assert np.sqrt((error[:, :3] ** 2).mean(axis=0)).max() < 0.05
    assert np.sqrt((error[:, 3:] ** 2).mean(axis=0)).max() < 0.5
    assert joined.on_skin_share > 0.99
    assert joined.run.serial == "BTSIM00000000006"
    # the board's own signals, to the last bit
    np.testing.assert_allclose(joined.run.counts - joined.run.tare, board.e[: len(joined.run.counts)], atol=1e-9)


def test_a_reference_of_a_tenth_of_the_rate(
    recorded: tuple[Recording, Source], board: BoardRows, reference: Reference
) -> None:
    samples = reference.samples
    thin = Samples(samples.t_s[::10], samples.wrench[::10, :3])
    found = join("board.mcap", board, replace(reference, samples=thin)).run.truth
    truth = truth_of(recorded, board)[: len(found), :3]
    assert np.sqrt(((found - truth) ** 2).mean(axis=0)).max() < 0.1


def test_a_gap_of_the_reference_is_left_out_and_not_bridged(board: BoardRows, reference: Reference) -> None:
    whole = join("board.mcap", board, reference)
    samples = reference.samples
    missing = (samples.t_s > samples.t_s[0] + 135.0) & (samples.t_s < samples.t_s[0] + 137.0)
    kept = Samples(samples.t_s[~missing], samples.wrench[~missing, :3])
    found = join("board.mcap", board, replace(reference, samples=kept))
    assert len(whole.run.truth) - len(found.run.truth) == pytest.approx(200, abs=10)


def spoilt(reference: Reference, how: str) -> Reference:
    samples = reference.samples
    t_s, force, torque = samples.t_s.copy(), samples.wrench[:, :3].copy(), samples.wrench[:, 3:].copy()
    mounting = reference.mounting
    if how == "another run":
        order = np.argsort((t_s // 1.7 * 0.61803) % 1.0, kind="stable")
        force, torque = force[order], torque[order]
    elif how == "jumping clock":
        t_s[len(t_s) * 4 // 5 :] += 0.08
    elif how == "newton metres":
        torque, zero = torque / 1000.0, np.array([0.0])
        mounting = Mounting(MOUNTING.rotation, zero.repeat(3))
    elif how == "wrong sign":
        mounting = Mounting(MOUNTING.rotation, MOUNTING.offset_mm, -1.0)
    elif how == "wrong offset":
        mounting = Mounting(MOUNTING.rotation, MOUNTING.offset_mm + np.array([0.0, 25.0, 0.0]))
    elif how == "grams":
        force = force * 101.97
        torque = torque * 101.97
    elif how == "saturated":
        force = np.clip(force, None, Nano17().zero[0] + 1.0)
    elif how == "wandering zero":
        force = force + np.sin(t_s / 11.0)[:, None]
    return replace(reference, samples=Samples(t_s, np.column_stack([force, torque])), mounting=mounting)


@pytest.mark.parametrize(
    ("how", "text"),
    [
        ("another run", r"not aligned: they agree best .* correlate with 0\.\d\d: expected at least 0\.4"),
        ("jumping clock", r"not aligned: the clocks drift by -?\d+ ppm over the run, and parts of it lie \d+ ms off"),
        ("newton metres", r"torque over force is 0\.\d+ mm about the fingertip's centre"),
        ("wrong sign", r"in \d% of the rows above 1 N the line of force meets the finger's skin"),
        ("wrong offset", r"in \d+% of the rows above 1 N the line of force meets the finger's skin"),
        ("grams", r"units of F per RMS count .* gf or mN"),
        ("saturated", r"read exactly [\d.]+ N along [xyz], the extreme: .* saturated"),
        ("wandering zero", r"where the board saw no contact the reference is up to \d\.\d\d N"),
    ],
)
def test_a_reference_that_does_not_belong_is_refused(
    how: str, text: str, board: BoardRows, reference: Reference
) -> None:
    with pytest.raises(RecordingError, match=text):
        join("board.mcap", board, spoilt(reference, how))


def test_a_board_that_says_too_little_is_refused(board: BoardRows, reference: Reference) -> None:
    with pytest.raises(RecordingError, match="3900 rows: expected at least 4000"):
        join("board.mcap", board.only(np.arange(len(board.t_s)) < 3900), reference)
    with pytest.raises(RecordingError, match="never at rest: the board saw no contact in 0 frames"):
        join("board.mcap", replace(board, quiet=np.zeros_like(board.quiet)), reference)
    missing = board.e.copy()
    missing[:500, 3] = np.nan
    with pytest.raises(RecordingError, match=r"500 of \d+ frames have no tare or lack an electrode"):
        join("board.mcap", replace(board, e=missing), reference)
    railed = board.counts.copy()
    railed[::50, 5] = 4095
    with pytest.raises(RecordingError, match="E6 is saturated"):
        join("board.mcap", replace(board, counts=railed), reference)


def test_a_repeated_press_is_not_a_clear_peak() -> None:
    t_s = np.arange(6000) * 0.01
    load = np.maximum(np.sin(t_s * np.pi), 0.0)  # every two seconds the same
    with pytest.raises(RecordingError, match=r"best agreement \(1\.00\) is not clear: another shift has 1\.00"):
        align("x", t_s, load, t_s[:5000] + 3.0, load[:5000])


def test_a_finger_is_chosen_among_several() -> None:
    assert choose_finger("rec", [2], None) == 2
    with pytest.raises(InputError, match="holds fingers 0, 2: expected one; choose it with --finger"):
        choose_finger("rec", [0, 2], None)
    with pytest.raises(InputError, match="holds fingers 0, 2, not 1"):
        choose_finger("rec", [0, 2], 1)
    check_serial("rec", "", "BTA")


def test_the_clocks_of_unequal_rates_to_a_fraction_of_a_step() -> None:
    rng = np.random.default_rng(0)
    true_s = np.arange(0.0, 120.0, 1e-3)
    keys = rng.uniform(0.0, 5.0, 400) * (rng.random(400) < 0.6)
    load = np.interp(true_s, np.cumsum(rng.uniform(0.15, 0.6, 400)), keys)
    board_s = true_s[::10] + 7.0
    counts = load[::10] ** 1.3 * 40.0 + rng.normal(0.0, 1.0, len(board_s))
    reference_s = true_s * (1.0 - 120e-6) - 55.1234
    alignment = align("x", board_s, counts, reference_s, load + rng.normal(0.0, 0.02, len(load)))
    wrong_s = alignment.to_reference_s(board_s) - ((board_s - 7.0) * (1.0 - 120e-6) - 55.1234)
    # a fraction of a step, though counts grow faster than force; without the drift the ends would be 7 ms off
    assert np.abs(wrong_s).max() < 2e-3
    assert alignment.drift_ppm == pytest.approx(-120.0, abs=15.0)


def test_the_hash_is_of_the_data(tmp_path: Path) -> None:
    a, b = tmp_path / "a", tmp_path / "b"
    a.write_bytes(b"counts")
    b.write_bytes(b"force")
    loaded = Loaded(SimpleNamespace(serial="BTA"), (a, b))  # type: ignore[arg-type]
    provenance = loaded.provenance(86_400)
    # sha256sum of "countsforce"
    assert provenance["data_sha256"] == hashlib.sha256(b"countsforce").hexdigest()
    assert (provenance["serial"], provenance["made_s"], provenance["files"]) == ("BTA", 86_400, ["a", "b"])
    b.write_bytes(b"forcf")
    assert loaded.provenance(0)["data_sha256"] != provenance["data_sha256"]


def test_a_shared_finger_is_the_same_finger_to_a_stranger(
    recorded: tuple[Recording, Source], board: BoardRows, reference: Reference, tmp_path: Path, capsys
) -> None:
    run = join("board.mcap", board, reference).run
    share(run, tmp_path / "thumb.npz", plate="Nano17, emulated", licence="CC0-1.0")
    again = load_run(tmp_path / "thumb.npz")
    assert again.serial == run.serial and abs(again.counts - run.counts).max() <= 0.5
    np.testing.assert_allclose(again.truth[:, :6], run.truth[:, :6])
    np.testing.assert_allclose(again.tare, run.tare, atol=0.5)
    assert main(["check", str(tmp_path / "thumb.npz")]) == 0
    assert "licence CC0-1.0" in capsys.readouterr().out
    fields = dict(np.load(tmp_path / "thumb.npz"))
    about = json.loads(str(fields["about"]))
    for wrong in ({"licence": ""}, {"units": about["units"] | {"F": "gf"}}, {"units": 3}):
        np.savez(tmp_path / "bad.npz", **fields | {"about": json.dumps(about | wrong)})
        assert main(["check", str(tmp_path / "bad.npz")]) == 2
