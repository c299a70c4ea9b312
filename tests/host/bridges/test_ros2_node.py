"""The ROS 2 node against ROS' message definitions and a fake rclpy, whose limits tests/support/fake_ros.py tells."""

from __future__ import annotations

import ast
import importlib
import math
import sys
import types
import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import fake_ros
import numpy as np
import pytest

import biotac
from biotac.clock import DeviceClock
from biotac.export import export
from biotac.wire.batches import join

PACKAGE = Path(__file__).parents[3] / "host/ros2/biotac_ros2"


@pytest.fixture
def ros(monkeypatch) -> fake_ros.Ros:
    ros = fake_ros.Ros()
    fake_ros.install(monkeypatch, ros)
    monkeypatch.syspath_prepend(str(PACKAGE))
    for name in ("biotac_ros2", "biotac_ros2.node"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return ros


def node() -> types.ModuleType:
    return importlib.import_module("biotac_ros2.node")


def unpaced(monkeypatch) -> None:
    """The node asks for real time; a test does not wait for it."""
    true_open = biotac.open
    monkeypatch.setattr(biotac, "open", lambda port, pace: true_open(port))
    monkeypatch.setattr("biotac.bridges.silence.time", types.SimpleNamespace(monotonic=lambda: 70.0))


def test_what_it_publishes_is_what_the_bag_of_a_recording_holds(ros, monkeypatch, tmp_path) -> None:
    from rosbags.rosbag2 import Reader

    unpaced(monkeypatch)
    source = "sim:shear.toml?fingers=2&seconds=3"
    with biotac.open(source, pace=0) as hand:
        hand.record(tmp_path / "a.mcap")
        hand.stream("results", "events")  # as the node does: without events a slip_level is not known
        hand.read(10.0)
    export(biotac.Recording(tmp_path / "a.mcap"), tmp_path / "a.ros2")
    bag: dict[str, list[object]] = {}
    with Reader(tmp_path / "a.ros2") as reader:
        for connection, _, raw in reader.messages():
            topic = connection.topic.removeprefix("/")
            bag.setdefault(topic, []).append(fake_ros.STORE.deserialize_cdr(raw, connection.msgtype))

    ros.parameters["port"] = source
    node().main()

    events = [(topic, message.data) for topic, message in ros.published if topic.endswith("event")]
    assert {("biotac/finger0/event", "TOUCH"), ("biotac/finger1/event", "TOUCH")} <= {*events}
    topics = {topic for topic, _ in ros.published if not topic.endswith("event")}
    names = ("wrench", "poc", "grip", "flags", "trust", "slip")
    assert topics == {f"biotac/finger{f}/{name}" for f in (0, 1) for name in names}
    for topic in topics:
        sent = [values(message) for name, message in ros.published if name == topic]
        assert len(sent) == 300
        # The bag's numbers come from um and mN, these from mm: each is rounded once more or less, in the last bit.
        np.testing.assert_allclose(sent, [values(message) for message in bag[topic]], rtol=4e-16)
    forces = np.array([values(m) for t, m in ros.published if t == "biotac/finger0/wrench"])
    assert np.nanmax(forces[:, 2]) > 1.0
    assert not ros.up


def values(message: object) -> list[float]:
    """All numbers but the stamp; the frame is asserted."""
    if hasattr(message, "header"):
        assert message.header.frame_id.startswith("biotac_finger")
    if hasattr(message, "wrench"):
        return [getattr(v, axis) for v in (message.wrench.force, message.wrench.torque) for axis in "xyz"]
    if hasattr(message, "point"):
        return [getattr(message.point, axis) for axis in "xyz"]
    return np.atleast_1d(message.data).astype(float).tolist()


def test_stamps_are_the_rounds_begin_on_the_nodes_clock(ros, monkeypatch) -> None:
    unpaced(monkeypatch)
    ros.up = True
    ros.parameters["port"] = "sim:press.toml?seconds=0.5"
    # Monotonic time stands still at 70 s, the node's clock says 1000 s: 930 s between them.
    monkeypatch.setattr("biotac.clock.stamps.time", types.SimpleNamespace(monotonic=lambda: 70.0))
    ros.now_ns = 1000 * 10**9
    fingers = node().Fingers()
    clock = DeviceClock()
    for k in range(20):
        clock.round_trip(50.0 + k, 1_000_000 * k, 50.0 + k)
    with fingers.hand as hand:
        batch = hand.read_batch(0.2)
        batch.t_us[:] += 5_000_000
        hand.clock = clock
        fingers.publish(batch)
    stamps = [m.header.stamp for topic, m in ros.published if topic.endswith("wrench")]
    # Device second 5 was monotonic second 55.
    want_s = 930 + 50 + batch.t_us / 1e6
    np.testing.assert_allclose([s.sec + s.nanosec / 1e9 for s in stamps], want_s, rtol=0, atol=1e-6)
    assert all(0 <= s.nanosec < 10**9 for s in stamps)
    assert ros.warnings == []


def test_without_a_clock_arrival_is_the_stamp_and_that_is_said_once(ros, monkeypatch) -> None:
    unpaced(monkeypatch)
    ros.up = True
    ros.parameters["port"] = "sim:press.toml?seconds=0.5"
    ros.now_ns = 1000 * 10**9
    fingers = node().Fingers()
    with fingers.hand as hand:
        batches = [hand.read_batch(0.2), hand.read_batch(0.2)]
        hand.clock = DeviceClock()
        for batch in batches:
            fingers.publish(batch)
    newest = [m.header.stamp for topic, m in ros.published if topic.endswith("wrench")][-1]
    assert newest.sec + newest.nanosec / 1e9 == pytest.approx(1000.0, abs=1e-4)
    assert len(ros.warnings) == 1


def test_invalid_is_nan_and_never_the_last_good_value(ros, monkeypatch) -> None:
    unpaced(monkeypatch)
    ros.parameters["port"] = "sim:press.toml?seconds=0.3"
    node().main()
    points = [m.point for topic, m in ros.published if topic.endswith("poc")]
    flags = [m.data for topic, m in ros.published if topic.endswith("flags")]
    invalid = [bool(value & biotac.FrameFlags.POC_INVALID) for value in flags]
    assert any(invalid)
    assert not all(invalid)
    assert [math.isnan(p.x) for p in points] == invalid


def test_a_finger_is_published_when_it_comes_and_is_nan_once_when_it_goes(ros, monkeypatch) -> None:
    unpaced(monkeypatch)
    ros.up = True
    ros.parameters["port"] = "sim:press.toml?seconds=0.5"
    with biotac.open("sim:press.toml?fingers=2&seconds=3", None) as hand:
        both, first = hand.read_batch(2.5), hand.read_batch(0.2)
    alone = first.wire["finger"] == 0
    first = replace(first, wire=first.wire[alone], seq=first.seq[alone], t_us=first.t_us[alone])
    fingers = node().Fingers()  # of one finger, when it started
    last_s = 70.0
    monkeypatch.setattr("biotac.bridges.silence.time", types.SimpleNamespace(monotonic=lambda: last_s))
    with fingers.hand:
        fingers.publish(both)
        assert not math.isnan(last_of(ros, 1)[0])
        for batch, ended in ((first, [1]), (join([]), []), (join([]), [0])):
            ros.published.clear()
            fingers.publish(batch)
            reported = [topic for topic, message in ros.published if topic.endswith("trust") and message.data == 0]
            assert reported == [f"biotac/finger{finger}/trust" for finger in ended]
            assert all(np.isnan(last_of(ros, finger)).all() for finger in ended)
            last_s += 0.08


def last_of(ros: fake_ros.Ros, finger: int) -> list[float]:
    """Force, torque, point and grip of the last messages."""
    last = {topic.removeprefix(f"biotac/finger{finger}/"): message for topic, message in ros.published}
    return [number for name in ("wrench", "poc", "grip") for number in values(last[name])]


def test_tare_says_which_finger_refused(ros, monkeypatch) -> None:
    unpaced(monkeypatch)
    ros.up = True
    ros.parameters["port"] = "sim:press.toml?seconds=4"
    fingers = node().Fingers()
    tare = ros.services["biotac/tare"]
    with fingers.hand as hand:
        blank = types.SimpleNamespace
        hand.read(0.2)
        early = tare(None, blank(success=None, message=None))

        def refuse(finger: int) -> None:
            raise biotac.CommandRefusedError("it moves")

        monkeypatch.setattr(hand, "tare", refuse)
        refused = tare(None, blank(success=None, message=None))
    assert isinstance(early.success, bool)
    assert (refused.success, refused.message) == (False, "finger 0: it moves")


def test_a_port_that_is_not_there_ends_it_with_a_line_and_the_code(ros, capsys) -> None:
    ros.parameters["port"] = "/dev/ttyNOWHERE7"
    with pytest.raises(SystemExit) as end:
        node().main()
    assert end.value.code == biotac.PortError.exit_code
    assert "biotac list" in capsys.readouterr().err
    assert not ros.up


def test_it_ends_when_ros_does(ros, monkeypatch) -> None:
    unpaced(monkeypatch)
    ros.parameters["port"] = "sim:press.toml"
    ros.ok_for_spins = 1
    node().main()
    assert ros.spins == 1


def test_the_package_declares_what_it_imports() -> None:
    tree = ET.parse(PACKAGE / "package.xml").getroot()
    declared = {e.text for e in tree.findall("exec_depend")}
    code = ast.parse((PACKAGE / "biotac_ros2/node.py").read_text())
    modules = {n.module.split(".")[0] for n in ast.walk(code) if isinstance(n, ast.ImportFrom) and n.module}
    modules |= {a.name for n in ast.walk(code) if isinstance(n, ast.Import) for a in n.names}
    from_ros = modules - set(sys.stdlib_module_names) - {"numpy", "biotac"}
    assert from_ros == declared
    assert f'version="{tree.findtext("version")}"' in (PACKAGE / "setup.py").read_text()
    assert tree.findtext("version") == biotac.__version__
