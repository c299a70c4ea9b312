"""The ROS 2 node in this process, on the real rclpy (PyPI's ``ros-rclpy[fastrtps]``): message by message.

test_ros2_real.py has it as a process, with a subscriber.
"""

import ast
import importlib
import importlib.util
import math
import os
import sys
import time
import types
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stand_in import StandIn

import biotac
from biotac.clock import DeviceClock
from biotac.export import export
from biotac.wire.batches import join

# ROS packages use calls that Python and their dependencies have deprecated.
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::PendingDeprecationWarning")

PACKAGE = Path(__file__).parents[3] / "host/ros2/biotac_ros2"


@dataclass
class Ros:
    """The node's messages and warnings, and the time of the node's clock."""

    monkeypatch: pytest.MonkeyPatch
    now_ns: int = 0
    published: list[tuple[str, Any]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def begin(self, port: str) -> types.ModuleType:
        """The node's module, which will open ``port``."""
        unpaced = f"{port}{'&' if '?' in port else '?'}pace=0" if port.startswith("sim:") else port
        self.monkeypatch.setattr(sys, "argv", ["node", "--ros-args", "-p", f"port:={unpaced}"])
        module = importlib.import_module("biotac_ros2.node")
        clock = types.SimpleNamespace(now=lambda: types.SimpleNamespace(nanoseconds=self.now_ns))
        self.monkeypatch.setattr("rclpy.node.Node.get_clock", lambda node: clock)
        self.monkeypatch.setattr("rclpy.impl.rcutils_logger.RcutilsLogger.warning", lambda _, text: self.warn(text))
        return module

    def fingers(self, port: str) -> Any:
        """A node that runs, as ``main`` makes it."""
        module = self.begin(port)
        module.rclpy.init()
        return module.Fingers()

    def warn(self, text: str) -> bool:
        self.warnings.append(text)
        return True


@pytest.fixture
def ros(monkeypatch, tmp_path) -> Iterator[Ros]:
    if importlib.util.find_spec("rclpy") is None and not os.environ.get("BIOTAC_CI"):
        pytest.skip("rclpy is not installed: pip install '.[test]'")
    import rclpy
    from rclpy.publisher import Publisher

    monkeypatch.setenv("ROS_DOMAIN_ID", str(os.getpid() % 100 + 1))
    monkeypatch.setenv("ROS_LOG_DIR", str(tmp_path))
    monkeypatch.syspath_prepend(str(PACKAGE))
    for name in ("biotac_ros2", "biotac_ros2.node"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    ros, publish = Ros(monkeypatch), Publisher.publish

    def heard(publisher: Any, message: Any) -> None:
        publish(publisher, message)  # raises for a message that ROS would not carry
        topic = publisher.topic_name.removeprefix("/")
        if topic not in ("parameter_events", "rosout"):  # which every node has
            ros.published.append((topic, message))

    monkeypatch.setattr(Publisher, "publish", heard)
    # No time passes, so that nothing is silent, however slowly this computer plays the board.
    monkeypatch.setattr(time, "monotonic", lambda: 70.0)
    yield ros
    rclpy.try_shutdown()


def test_what_it_publishes_is_what_the_bag_of_a_recording_holds(ros, tmp_path) -> None:
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    source = "sim:shear.toml?fingers=2&seconds=3"
    with biotac.open(source, pace=0) as hand:
        hand.record(tmp_path / "a.mcap")
        hand.stream("results", "events")  # as the node does: without events a slip_level is not known
        hand.read(10.0)
    export(biotac.Recording(tmp_path / "a.mcap"), tmp_path / "a.ros2")
    bag: dict[str, list[object]] = {}
    store = get_typestore(Stores.ROS2_HUMBLE)
    with Reader(tmp_path / "a.ros2") as reader:
        for connection, _, raw in reader.messages():
            topic = connection.topic.removeprefix("/")
            bag.setdefault(topic, []).append(store.deserialize_cdr(raw, connection.msgtype))

    ros.begin(source).main()

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
    assert not importlib.import_module("rclpy").ok()


def values(message: object) -> list[float]:
    """All numbers but the stamp; the frame is asserted."""
    if hasattr(message, "header"):
        assert message.header.frame_id.startswith("biotac_finger")
    if hasattr(message, "wrench"):
        return [getattr(v, axis) for v in (message.wrench.force, message.wrench.torque) for axis in "xyz"]
    if hasattr(message, "point"):
        return [getattr(message.point, axis) for axis in "xyz"]
    return np.atleast_1d(message.data).astype(float).tolist()


def test_stamps_are_the_rounds_begin_on_the_nodes_clock(ros) -> None:
    # Monotonic time stands still at 70 s, the node's clock says 1000 s: 930 s between them.
    ros.now_ns = 1000 * 10**9
    fingers = ros.fingers("sim:press.toml?seconds=0.5")
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


def test_without_a_clock_arrival_is_the_stamp_and_that_is_said_once(ros) -> None:
    ros.now_ns = 1000 * 10**9
    fingers = ros.fingers("sim:press.toml?seconds=0.5")
    with fingers.hand as hand:
        batches = [hand.read_batch(0.2), hand.read_batch(0.2)]
        hand.clock = DeviceClock()
        for batch in batches:
            fingers.publish(batch)
    newest = [m.header.stamp for topic, m in ros.published if topic.endswith("wrench")][-1]
    assert newest.sec + newest.nanosec / 1e9 == pytest.approx(1000.0, abs=1e-4)
    assert len(ros.warnings) == 1


def test_invalid_is_nan_and_never_the_last_good_value(ros) -> None:
    ros.begin("sim:press.toml?seconds=0.3").main()
    points = [m.point for topic, m in ros.published if topic.endswith("poc")]
    flags = [m.data for topic, m in ros.published if topic.endswith("flags")]
    invalid = [bool(value & biotac.FrameFlags.POC_INVALID) for value in flags]
    assert any(invalid)
    assert not all(invalid)
    assert [math.isnan(p.x) for p in points] == invalid


def test_a_finger_is_published_when_it_comes_and_is_nan_once_when_it_goes(ros, monkeypatch) -> None:
    with biotac.open("sim:press.toml?fingers=2&seconds=3") as hand:
        both, first = hand.read_batch(2.5), hand.read_batch(0.2)
    alone = first.wire["finger"] == 0
    first = replace(first, wire=first.wire[alone], seq=first.seq[alone], t_us=first.t_us[alone])
    fingers = ros.fingers("sim:press.toml?seconds=0.5")  # of one finger, when it started
    last_s = 70.0
    monkeypatch.setattr(time, "monotonic", lambda: last_s)
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


def last_of(ros: Ros, finger: int) -> list[float]:
    """Force, torque, point and grip of the last messages."""
    last = {topic.removeprefix(f"biotac/finger{finger}/"): message for topic, message in ros.published}
    return [number for name in ("wrench", "poc", "grip") for number in values(last[name])]


def test_tare_says_which_finger_refused(ros) -> None:
    fingers = ros.fingers("sim:press.toml?seconds=4")
    (service,) = [own for own in fingers.services if own.srv_name.endswith("biotac/tare")]
    tare, answer = service.callback, service.srv_type.Response
    with fingers.hand as hand:
        hand.read(0.2)
        early = tare(None, answer())

        def refuse(finger: int) -> None:
            raise biotac.CommandRefusedError("it moves")

        fingers.hand = StandIn(hand, tare=refuse)
        refused = tare(None, answer())
    assert isinstance(early.success, bool)
    assert (refused.success, refused.message) == (False, "finger 0: it moves")


def test_a_port_that_is_not_there_ends_it_with_a_line_and_the_code(ros, capsys) -> None:
    node = ros.begin("/dev/ttyNOWHERE7")
    with pytest.raises(SystemExit) as end:
        node.main()
    assert end.value.code == biotac.PortError.exit_code
    assert "biotac list" in capsys.readouterr().err
    assert not node.rclpy.ok()


def test_it_ends_when_ros_does(ros, monkeypatch) -> None:
    node, spins = ros.begin("sim:press.toml"), []

    def spin_once(own: Any, timeout_sec: float) -> None:
        spins.append(own)
        node.rclpy.shutdown()

    monkeypatch.setattr("rclpy.spin_once", spin_once)
    node.main()
    assert len(spins) == 1


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
