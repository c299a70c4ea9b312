"""`export --beside`: the robot's own messages as they were recorded; and `--frame`, which turns a finger on request."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from record_all import record_all
from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import biotac
from biotac.cli.main import main

NEVER = QosTime(2147483647, 4294967295)
LATCHED = Qos(QosHistory.KEEP_LAST, 1, QosReliability.RELIABLE, QosDurability.TRANSIENT_LOCAL, NEVER, NEVER,
              QosLiveliness.AUTOMATIC, NEVER, False)  # fmt: skip


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> Path:
    return record_all("sim:press.toml?seconds=3", tmp_path_factory.mktemp("beside") / "a.mcap")


@pytest.mark.parametrize("storage", list(StoragePlugin))
@pytest.mark.parametrize("has_hashes", [True, False])
def test_a_ros_2_bag_of_any_distribution_keeps_its_qos(recording, tmp_path, storage, has_hashes) -> None:
    """ROS 2 Humble writes no hash of a type, and the sqlite3 storage no definition."""
    store: Any = get_typestore(Stores.ROS2_HUMBLE)
    with Writer(tmp_path / "tf.ros2", version=8, storage_plugin=storage) as bag:
        to = bag.add_connection("/tf_static", "std_msgs/msg/String", typestore=store, offered_qos_profiles=(LATCHED,))
        bag.write(to, 5, store.serialize_cdr(store.types["std_msgs/msg/String"]("tree"), to.msgtype))
    if not has_hashes:
        facts = tmp_path / "tf.ros2" / "metadata.yaml"
        facts.write_text(re.sub(r"RIHS01_\w*", "''", facts.read_text()))
    out = tmp_path / "out.ros2"
    assert main(["export", str(recording), str(out), "--beside", str(tmp_path / "tf.ros2")]) == 0
    with Reader(out) as bag:
        (kept,) = [c for c in bag.connections if c.topic == "/tf_static"]
        assert (kept.ext.offered_qos_profiles, kept.digest) == ([LATCHED], store.hash_rihs01(kept.msgtype))
        ((_, at_ns, raw),) = bag.messages([kept])
        assert at_ns == 5 and store.deserialize_cdr(raw, kept.msgtype).data == "tree"


def test_a_ros_1_bag_keeps_who_latched(recording, tmp_path) -> None:
    store: Any = get_typestore(Stores.ROS1_NOETIC)
    with Writer1(tmp_path / "tf.bag") as bag:
        to = bag.add_connection("/tf_static", "std_msgs/msg/String", typestore=store, callerid="/robot", latching=1)
        bag.write(to, 5, store.serialize_ros1(store.types["std_msgs/msg/String"]("tree"), to.msgtype))
    assert main(["export", str(recording), str(tmp_path / "o.bag"), "--beside", str(tmp_path / "tf.bag")]) == 0
    with Reader1(tmp_path / "o.bag") as bag:
        (kept,) = [c for c in bag.connections if c.topic == "/tf_static"]
        assert (kept.ext.callerid, kept.ext.latching) == ("/robot", 1)


def test_a_frame_is_renamed_and_turned_only_where_it_is_told(recording, tmp_path, capsys) -> None:
    arrays = {}
    for name, how in (("named", "index=rh_ffdistal"), ("turned", "index=rh_ffdistal@90,0,0")):
        assert main(["export", str(recording), str(tmp_path / f"{name}.npz"), "--frame", how]) == 0
        arrays[name] = np.load(tmp_path / f"{name}.npz")
        assert "rh_ffdistal@" not in str(arrays[name]["columns"])
    force_n = biotac.Recording(recording).frames["force_n"]
    named, turned = (arrays[name]["finger0/frames/force_n"] for name in ("named", "turned"))
    assert np.array_equal(named, force_n, equal_nan=True)
    assert np.allclose(turned, np.column_stack([force_n[:, 0], -force_n[:, 2], force_n[:, 1]]), equal_nan=True)
    assert main(["export", str(recording), str(tmp_path / "b.npz"), "--frame", "index=a@90,x,0"]) == 2
    assert "expected ID or ID@ROLL,PITCH,YAW in degrees" in capsys.readouterr().err
