"""What other programs see of a recording: ROS 2 messages, read by rosbags with ROS' own definitions, and by Rerun."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from record_all import blocks_of, record_all
from ros_topics import STORE, messages_of
from rosbags.typesys import get_types_from_msg

import biotac
from biotac.board.gap import Gap
from biotac.recording import plot_ros, plots, writer
from biotac.recording.facts import Facts
from biotac.wire import messages_gen as wire
from biotac.wire.frames import electrode_signals

SECONDS = 3
AFTER_2038_NS = 2**32 * 10**9


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    return record_all(f"sim:press.toml?fingers=2&seconds={SECONDS}", tmp_path_factory.mktemp("ros") / "a.mcap")


@pytest.mark.parametrize("name", plot_ros.SCHEMAS)
def test_the_types_are_those_of_ros(name: str) -> None:
    types = get_types_from_msg(plot_ros.SCHEMAS[name], name)
    assert name in types
    for type_name, (_, fields) in types.items():
        assert fields == STORE.fielddefs[type_name][1]


def test_numbers_are_those_of_the_frames_and_thinned(recorded: Path) -> None:
    recording = biotac.Recording(recorded)
    for finger in (0, 1):
        of_finger = recording.frames["finger"] == finger
        frames, sent = recording.frames[of_finger], recording.wire[of_finger]
        pac = recording.pac[recording.pac["finger"] == finger]
        counts = np.column_stack([frames[name] for name in ("counts", "pdc", "tac", "tdc")])
        expected = {
            "force": (plots.FORCE_US, np.column_stack([frames["force_n"], frames["pressure_force_n"]])),
            "torque": (plots.FORCE_US, np.column_stack([frames["torque_nmm"], frames["torsion_nmm"]]) / 1000),
            "flags": (plots.FORCE_US, frames["flags"]),
            "counts": (plots.COUNTS_US, counts),
            "signals": (plots.COUNTS_US, electrode_signals(sent)),
            "pac": (plots.COUNTS_US, pac["pac"]),
        }
        stamps = dict(zip(frames["seq"].tolist(), recording.stamp_ns(frames["t_us"]).tolist(), strict=True))
        for topic, (period_us, values) in expected.items():
            row_of = dict(zip((pac if topic == "pac" else frames)["seq"].tolist(), values, strict=True))
            messages = messages_of(recorded, f"/biotac/finger{finger}/{topic}")
            n = SECONDS * 1_000_000 // period_us
            assert len(messages) in (n, n + 1), topic  # the first period was under way already
            for stamp_ns, seq, message in messages:
                np.testing.assert_array_equal(np.float32(message.data), np.float32(row_of[seq]), err_msg=topic)
                if topic != "pac":
                    assert stamp_ns == stamps[seq]


def test_a_contact_is_where_and_which_way(recorded: Path) -> None:
    rows = {int(row["seq"]): row for row in biotac.Recording(recorded)[1]}
    poses = messages_of(recorded, "/biotac/finger1/contact")
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
    data = plot_ros.contact(0, (0.0, 0.0, 0.0), force_n, AFTER_2038_NS)
    turn = STORE.deserialize_cdr(data, plot_ros.POSE).pose.orientation
    assert turned_x(turn.x, turn.y, turn.z, turn.w) == pytest.approx(unit(np.array(force_n, float)), abs=1e-6)


def test_tares_events_and_gaps_are_logged(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with biotac.open("sim:press.toml?seconds=3") as hand:
        facts = Facts(hand.info, [], hand.board.settings())
        with_blocks = record_all("sim:press.toml?seconds=3", tmp_path / "a.mcap")
    recorder = writer.Writer(path, facts, "test")
    first, *others = blocks_of(biotac.Recording(with_blocks))
    recorder.write(first)
    source = biotac.Recording(with_blocks)
    back_us = int(source.heads()[1].rest.first_us)
    gap = Gap("silence", back_us - 10_000, back_us, 10**9, 3 * 10**9, 7)
    recorder.write_gap(gap)
    for block in others:
        recorder.write(block)
    recorder.close()
    (stamp_ns, _, message), *_ = messages_of(path, "/biotac/log")
    assert (message.msg, message.level) == (gap.line(), plot_ros.WARN)
    assert stamp_ns == biotac.Recording(path).stamp_ns(np.array([back_us]))  # where the rows go on
    tares = [m for m in biotac.Recording(path).messages if isinstance(m, wire.Tare)]
    logs = messages_of(path, "/biotac/finger0/log")
    assert [seq for _, seq, m in logs if m.msg.startswith("tare")] == [m.seq for m in tares]
    assert logs[0][2].msg.startswith("tare START")


@pytest.mark.nightly
def test_rerun_draws_it_without_being_told(recorded: Path, tmp_path: Path) -> None:
    """Its importer gives scalars with which its time series, and poses with which its 3D view draw by themselves."""
    pytest.importorskip("rerun", reason="Rerun (half a gigabyte) is not here; pip install 'biotac-gateway[nightly]'")
    out = tmp_path / "a.rrd"
    rerun = [sys.executable, "-m", "rerun"]
    subprocess.run([*rerun, "mcap", "convert", str(recorded), "-o", str(out)], check=True, capture_output=True)
    printed = subprocess.run([*rerun, "rrd", "print", str(out)], check=True, capture_output=True, text=True).stdout
    archetypes = {name: "Scalars" for name in ("force", "torque", "counts", "signals", "pac")}
    for topic, archetype in (archetypes | {"contact": "InstancePoses3D", "log": "TextLog"}).items():
        lines = [line for line in printed.splitlines() if f" /biotac/finger0/{topic} " in line]
        assert any(f"{archetype}:" in line for line in lines), topic
