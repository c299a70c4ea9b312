"""One row: the same numbers live, loaded, as a DataFrame and in every export, to the bit or by the stated rounding."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest
from rosbags.highlevel import AnyReader

import biotac
from biotac.export import export
from biotac.wire.fields import FRAME_FIELDS, Field

FINGERS = (0, 1)
#: (finger, flat name) -> float64 (n,), NaN where there is no value
Numbers = dict[tuple[int, str], np.ndarray]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> tuple[np.ndarray, biotac.Recording]:
    """Live rows with missing words and invalid results in them, and the recording of the same."""
    path = tmp_path_factory.mktemp("same") / "a.mcap"
    with biotac.open(f"sim:faults.toml?fingers={len(FINGERS)}&seconds=6") as hand:
        hand.record(path)
        rows = hand.read_batch(100).frames
    return rows, biotac.Recording(path)


def of_rows(rows: np.ndarray) -> Numbers:
    """What a row says, flat."""
    return {
        (finger, name): valid(
            field, rows[field.name][rows["finger"] == finger].reshape(-1, len(field.flat_names()))[:, k]
        )
        for finger in FINGERS
        for field in FRAME_FIELDS[1:]
        for k, name in enumerate(field.flat_names())
    }


def valid(field: Field, values: np.ndarray) -> np.ndarray:
    out = values.astype(np.float64)  # holds each of the rows' types exactly
    if field.invalid is not None:
        out[values == field.invalid] = np.nan
    return out


def of_table(finger: np.ndarray, column: Callable[[str], np.ndarray]) -> Numbers:
    """A flat table, in any order of fingers."""
    return {
        (its, name): valid(field, column(name)[finger == its])
        for its in FINGERS
        for field in FRAME_FIELDS[1:]
        for name in field.flat_names()
    }


def from_pandas(recording: biotac.Recording, folder: Path) -> Numbers:
    table = recording.to_pandas()
    return of_table(table["finger"].to_numpy(), lambda name: table[name].to_numpy(np.float64, na_value=np.nan))


def from_csv(recording: biotac.Recording, folder: Path) -> Numbers:
    with export(recording, folder / "a.csv")[0].open(newline="") as file:
        rows = list(csv.DictReader(file))
    return of_table(
        np.array([int(row["finger"]) for row in rows]), lambda name: np.array([float(row[name]) for row in rows])
    )


def from_parquet(recording: biotac.Recording, folder: Path) -> Numbers:
    table = pq.read_table(export(recording, folder / "a.parquet")[0])
    return of_table(
        table["finger"].to_numpy(),
        lambda name: np.array([np.nan if v is None else v for v in table[name].to_pylist()], np.float64),
    )


def from_groups(group: Callable[[int, str], np.ndarray]) -> Numbers:
    return {
        (its, name): valid(field, group(its, field.name).reshape(-1, len(field.flat_names()))[:, k])
        for its in FINGERS
        for field in FRAME_FIELDS[1:]
        for k, name in enumerate(field.flat_names())
    }


def from_hdf5(recording: biotac.Recording, folder: Path) -> Numbers:
    with h5py.File(export(recording, folder / "a.h5")[0]) as file:
        return from_groups(lambda finger, name: file[f"finger{finger}/frames/{name}"][:])


def from_npz(recording: biotac.Recording, folder: Path) -> Numbers:
    with np.load(export(recording, folder / "a.npz")[0]) as file:
        return from_groups(lambda finger, name: file[f"finger{finger}/frames/{name}"])


def same(got: Numbers, wanted: Numbers) -> None:
    assert got.keys() == wanted.keys()
    for key, values in wanted.items():
        np.testing.assert_array_equal(got[key], values, err_msg=str(key))  # NaN equals NaN, and nothing else is near


def test_what_is_loaded_is_what_was_live(recorded) -> None:
    live, recording = recorded
    with pytest.warns(biotac.RecordingWarning, match="gap"):
        loaded = biotac.load(recording.path)
    for rows in (loaded, recording.frames):
        assert (rows.dtype, rows.tobytes()) == (live.dtype, live.tobytes())
    for field in ("counts", "poc_mm", "force_n", "tare"):  # some are missing, some not
        some = np.isnan(np.concatenate([its for (_, name), its in of_rows(live).items() if name.startswith(field[:4])]))
        assert some.any() and not some.all()


@pytest.mark.parametrize("other", [from_pandas, from_csv, from_parquet, from_hdf5, from_npz])
def test_to_the_bit(recorded, tmp_path: Path, other: Callable[[biotac.Recording, Path], Numbers]) -> None:
    live, recording = recorded
    wanted = of_rows(live)
    same(other(recording, tmp_path), wanted)


def test_a_ros_2_bag_in_its_own_units_rounded_once(recorded, tmp_path: Path) -> None:
    """N as it is; m and N*m are a thousandth of mm and N*mm in float64; counts keep 65535 for what is missing."""
    live, recording = recorded
    (bag,) = export(recording, tmp_path / "a.ros2")
    got: dict[str, list[list[float]]] = {}
    with AnyReader([bag]) as reader:
        for connection, _, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            if connection.topic.count("/") != 3:
                continue  # of the whole hand
            _, _, finger, kind = connection.topic.split("/")
            for name, values in {
                "wrench": lambda m: {"force_n": xyz(m.wrench.force), "torque_nmm": xyz(m.wrench.torque)},
                "poc": lambda m: {"poc_mm": xyz(m.point)},
                "flags": lambda m: {"flags": [m.data]},
                "counts": lambda m: {"counts": m.data[:19], "slow": m.data[19:]},
                "pac": lambda m: {},
                "bands": lambda m: {},
            }[kind](message).items():
                got.setdefault(f"{finger}/{name}", []).append(values)
    for finger in FINGERS:
        mine = live[live["finger"] == finger]
        wanted = {name: mine[name] for name in ("force_n", "flags", "counts")}
        wanted |= {name: mine[name] / 1000 for name in ("torque_nmm", "poc_mm")}
        wanted["slow"] = np.column_stack([mine[name] for name in ("pdc", "tac", "tdc")])
        for name, values in wanted.items():
            np.testing.assert_array_equal(np.array(got[f"finger{finger}/{name}"]), values.reshape(len(mine), -1))


def xyz(vector) -> list[float]:
    return [vector.x, vector.y, vector.z]
