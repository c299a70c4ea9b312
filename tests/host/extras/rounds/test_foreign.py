"""Messages of no BioTac give no force, and the reason is told; stale words are missing."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from robot_messages import Robot

import biotac
from biotac.errors import InputError
from biotac.recording.recompute import recompute
from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire
from biotac.wire import slots
from biotac.wire.batches import Batch

FAULT, CONTACT = wire.FrameFlags.SENSOR_FAULT, wire.FrameFlags.CONTACT
PRESSED = load_source("press.toml", fingers=1, seconds=12.0).samples.astype(int)
E = slots.ELECTRODE_SLOT


def played(port: str) -> tuple[Batch, list[str]]:
    with biotac.open(port) as hand:
        hand.stream("results", "events")
        return hand.read_batch(1000.0), list(hand.link.notes)


def replayed(tmp_path: Path, rows: np.ndarray, robot: Robot | None = None) -> tuple[Batch, list[str]]:
    return played((robot or Robot(pac=True)).write(tmp_path / "a.bag", rows))


def test_the_press_itself_has_force(tmp_path: Path) -> None:
    batch, notes = replayed(tmp_path, PRESSED)
    touched = (batch.frames["flags"] & CONTACT) != 0
    assert notes == [] and touched.sum() > 200 and np.isfinite(batch.frames["force_n"][touched]).all()
    assert not (batch.frames["flags"] & FAULT).any()


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda rows: rows[..., E] * np.array([1] * 16 + [0] * 3), "3 electrodes say 0"),
        pytest.param(lambda rows: rows[..., E] * 10, "expected 0 to 4095", marks=pytest.mark.nightly),
        pytest.param(
            lambda rows: 200 + np.maximum(0, 3000 - rows[..., E]), "at 1900 to 3600", marks=pytest.mark.nightly
        ),
    ],
)
def test_other_skins_are_no_biotac(tmp_path: Path, change: Callable[[np.ndarray], np.ndarray], words: str) -> None:
    rows = PRESSED.copy()
    rows[..., E] = change(rows)
    batch, notes = replayed(tmp_path, rows)
    assert any("these are not a BioTac's counts" in text and words in text for text in notes), notes
    frames = batch.frames
    assert np.isnan(frames["force_n"]).all() and np.isnan(frames["poc_mm"]).all() and (frames["flags"] & FAULT).all()
    status = [m for m in batch.messages if isinstance(m, wire.SensorStatus)][-1]
    assert status.sensor_fault == wire.SensorFault.OTHER_KIND


@pytest.mark.parametrize("first", [0, pytest.param(1, marks=pytest.mark.nightly)])
def test_every_second_electrode_frozen_is_missing(tmp_path: Path, first: int) -> None:
    rows = PRESSED.copy()
    rows[..., E[first::2]] = rows[0, 0, E[first::2]]
    batch, notes = replayed(tmp_path, rows)
    assert (batch.frames["counts"][:, first::2] == wire.INVALID_COUNT).all()
    assert np.isnan(batch.frames["force_n"]).all()
    assert f"finger 0: {', '.join(f'E{k}' for k in range(first + 1, 20, 2))} repeat" in notes[-1]


def test_a_word_that_is_repeated_while_others_move_is_missing(tmp_path: Path) -> None:
    rows = PRESSED.copy()
    rows[300:600, 0, E[4]] = rows[300, 0, E[4]]
    batch, _ = replayed(tmp_path, rows)
    missing = np.flatnonzero(batch.frames["counts"][:, 4] == wire.INVALID_COUNT)
    assert 300 < missing[0] <= 401 and missing[-1] == 599 and len(missing) == 600 - missing[0]
    assert (batch.frames["counts"][:, :4] != wire.INVALID_COUNT).all()


def test_24_electrodes_are_a_contact_finger(tmp_path: Path) -> None:
    rows = np.concatenate([PRESSED, PRESSED[..., E[:5]]], axis=2)
    batch, notes = replayed(tmp_path, rows)
    frames = batch.frames
    assert notes == ["finger 0: 24 electrodes are a BioTac SP's: it has contact, but no force"]
    assert ((frames["flags"] & CONTACT) != 0).sum() > 200 and (frames["flags"] & FAULT).all()
    for name in ("force_n", "poc_mm", "torque_nmm"):
        assert np.isnan(frames[name]).all(), name
    raw = [m for m in batch.messages if isinstance(m, wire.SpCounts)]
    np.testing.assert_array_equal([m.counts for m in raw], np.append(rows[:, 0, E], rows[:, 0, 44:], axis=1))
    assert [m.seq for m in raw] == frames["seq"].tolist()


@pytest.mark.parametrize("serial", ["BTSP050400018017", pytest.param("BTTB050400018017", marks=pytest.mark.nightly)])
def test_a_serial_of_an_sp_gives_no_force_in_any_message(tmp_path: Path, serial: str) -> None:
    port = Robot("biotac_sensors/msg/BioTacHand").write(tmp_path / "a.bag", PRESSED, serials=(serial,))
    with biotac.open(port) as hand, hand.record(tmp_path / "a.mcap"):
        hand.board.set_calibration(0, biotac.Calibration(pressure_gain_nn=10_000_000))
        hand.stream("results")
        frames = hand.read(1000.0)
    assert (frames["flags"] & FAULT).all() and np.isnan(frames["force_n"]).all()
    assert ((frames["flags"] & CONTACT) != 0).sum() > 200 and np.nanmax(frames["pressure_force_n"]) > 1.0
    recording = biotac.Recording(tmp_path / "a.mcap")
    recompute(recording, tmp_path / "b.mcap", {})
    recompute(recording, tmp_path / "c.mcap", {}, keep_tare=True)
    for name in "bc":
        again = biotac.Recording(tmp_path / f"{name}.mcap").frames
        assert len(again) == len(frames) and np.isnan(again["force_n"]).all()


def test_24_columns_are_refused_at_every_door(tmp_path: Path) -> None:
    counts = np.full((30, 24), 3000)
    words = "cutting them to 19 does not make it a BioTac"
    with pytest.raises(ValueError, match=words):
        biotac.Finger().feed(counts)
    with pytest.raises(ValueError, match=words):
        biotac.compute(counts, np.full(19, 3000.0))
    np.savez(tmp_path / "a.npz", E=counts)
    with pytest.raises(InputError, match=words):
        load_source(tmp_path / "a.npz")
    rows = biotac.Finger(serial=b"BTSP050400018017").feed(np.full((30, 19), 3000))
    assert (rows["flags"] & np.uint32(FAULT)).all()
