"""Messages of ROS 2 types in a recording: read by rosbags with ROS' own definitions, and by Rerun (nightly)."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from record_all import record_all
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

import biotac
from biotac.recording import plot_ros
from biotac.wire.frames import electrode_signals

STORE = get_typestore(Stores.ROS2_HUMBLE)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    return record_all("sim:press.toml?fingers=2&seconds=3", tmp_path_factory.mktemp("ros") / "a.mcap")


def of_topic(path: Path, topic: str) -> list[tuple[int, int, Any]]:
    """(log time, seq, message) as rosbags reads it."""
    found = []
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages(topics=[topic]):
            assert schema is not None and (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
            found.append((message.log_time, message.sequence, STORE.deserialize_cdr(message.data, schema.name)))
    return found


@pytest.mark.parametrize("name", plot_ros.SCHEMAS)
def test_the_types_are_those_of_ros(name: str) -> None:
    mine = get_types_from_msg(plot_ros.SCHEMAS[name], name)
    assert mine == {its: STORE.fielddefs[its] for its in mine} and name in mine


def test_force_and_signals_are_those_of_the_frames(recorded: Path) -> None:
    recording = biotac.Recording(recorded)
    for finger in (0, 1):
        mine = recording.frames["finger"] == finger
        rows = dict(zip(recording.frames["seq"][mine].tolist(), recording.frames[mine], strict=True))
        signals = electrode_signals(recording.wire[mine])
        signal_of = dict(zip(rows, signals, strict=True))
        forces = of_topic(recorded, f"/biotac/finger{finger}/force")
        assert 70 < len(forces) < 80
        for stamp_ns, seq, message in forces:
            np.testing.assert_array_equal(message.data, rows[seq]["force_n"].astype(np.float32))
            assert stamp_ns == recording.stamp_ns(rows[seq]["t_us"][None])[0]
            assert (message.layout.dim[0].label, message.layout.dim[0].size) == ("force on the finger, N: x, y, z", 3)
        for _, seq, message in of_topic(recorded, f"/biotac/finger{finger}/signals"):
            np.testing.assert_array_equal(message.data, signal_of[seq].astype(np.float32))


def test_a_contact_is_where_and_which_way(recorded: Path) -> None:
    rows = {int(row["seq"]): row for row in biotac.Recording(recorded)[1]}
    poses = of_topic(recorded, "/biotac/finger1/contact")
    assert poses
    for stamp_ns, seq, message in poses:
        at, turn = message.pose.position, message.pose.orientation
        assert [at.x, at.y, at.z] == (rows[seq]["poc_mm"] / 1000).astype(np.float32).tolist()
        assert message.header.frame_id == "biotac_finger1"
        assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == stamp_ns
        assert turned_x(turn.x, turn.y, turn.z, turn.w) == pytest.approx(unit(rows[seq]["force_n"]), abs=1e-6)


def unit(force_n: np.ndarray) -> np.ndarray:
    size = float(np.linalg.norm(force_n))
    return force_n / size if size > 0 else np.array([1.0, 0.0, 0.0])


def turned_x(x: float, y: float, z: float, w: float) -> list[float]:
    """Where a quaternion turns (1, 0, 0) to."""
    return [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]


@pytest.mark.parametrize("force_n", [(1, 0, 0), (-1, 0, 0), (-1, 1e-9, 0), (0, 0, -2), (3, 4, 12), (0, 0, 0)])
def test_every_direction_has_a_turn(force_n: tuple[float, float, float]) -> None:
    data = plot_ros.contact(0, (0.0, 0.0, 0.0), force_n, 5)
    turn = STORE.deserialize_cdr(data, plot_ros.POSE).pose.orientation
    assert turned_x(turn.x, turn.y, turn.z, turn.w) == pytest.approx(unit(np.array(force_n, float)), abs=1e-6)


@pytest.mark.nightly
def test_rerun_draws_it_without_being_told(recorded: Path, tmp_path: Path) -> None:
    """Its importer gives scalars with which its time series, and poses with which its 3D view draw by themselves."""
    pytest.importorskip("rerun", reason="Rerun (half a gigabyte) is not here; pip install 'biotac-gateway[rerun]'")
    out = tmp_path / "a.rrd"
    rerun = [sys.executable, "-m", "rerun"]
    subprocess.run([*rerun, "mcap", "convert", str(recorded), "-o", str(out)], check=True, capture_output=True)
    printed = subprocess.run([*rerun, "rrd", "print", str(out)], check=True, capture_output=True, text=True).stdout
    for topic, archetype in (("force", "Scalars"), ("signals", "Scalars"), ("contact", "InstancePoses3D")):
        lines = [line for line in printed.splitlines() if f" /biotac/finger0/{topic} " in line]
        assert any(f"{archetype}:" in line for line in lines), topic
