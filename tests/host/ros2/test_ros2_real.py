"""The ROS 2 node with the real rclpy, which PyPI has (``ros-rclpy[fastrtps]``)."""

import importlib.util
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[3] / "host" / "ros2" / "biotac_ros2"

pytestmark = pytest.mark.skipif(
    importlib.util.find_spec("rclpy") is None and not os.environ.get("BIOTAC_CI"),
    reason="rclpy is not installed: pip install '.[test]'",
)

LISTENS = """
import json
import rclpy
from geometry_msgs.msg import WrenchStamped
from biotac_ros2.node import Fingers
rclpy.init()
node, heard = Fingers(), []
ear = rclpy.create_node("ear")
ear.create_subscription(WrenchStamped, "biotac/finger0/wrench", heard.append, 1000)
for batch in node.hand.batches():
    node.publish(batch)
    for _ in range(4 * max(1, len(batch.wire))):
        rclpy.spin_once(ear, timeout_sec=0.0)
for _ in range(1000):
    rclpy.spin_once(ear, timeout_sec=0.0)
node.hand.close()
stamps = [m.header.stamp.sec * 10**9 + m.header.stamp.nanosec for m in heard]
print(json.dumps([len(heard), sorted(stamps) == stamps, heard[0].header.frame_id,
                  max(abs(m.wrench.force.z) for m in heard if m.wrench.force.z == m.wrench.force.z)]))
"""


def started(code: str, port: str, tmp_path: Path) -> subprocess.Popen[str]:
    # A separate domain, so that tests beside each other do not hear each other.
    env = os.environ | {
        "PYTHONPATH": str(PACKAGE),
        "ROS_DOMAIN_ID": str(os.getpid() % 100 + 1),
        "ROS_LOG_DIR": str(tmp_path),
        "PYTHONUNBUFFERED": "1",
    }
    words = [sys.executable, "-c", code, "--ros-args", "-p", f"port:={port}"]
    return subprocess.Popen(words, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def test_a_subscriber_hears_the_wrench_in_the_order_of_time(tmp_path: Path) -> None:
    program = started(LISTENS, "sim:press.toml?seconds=4", tmp_path)
    output, errors = program.communicate()
    assert program.returncode == 0, errors
    received, in_order, frame_id, most_n = json.loads(output.splitlines()[-1])
    assert received > 350 and in_order and frame_id == "biotac_finger0"
    assert most_n > 0.5


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_the_node_without_a_word(how: signal.Signals, tmp_path: Path) -> None:
    code = (
        "from biotac_ros2 import node\nown = node.spin\n"
        "def spin(its):\n node.rclpy.spin_once(its, timeout_sec=0)\n print('spins', flush=True)\n own(its)\n"
        "node.spin = spin\nnode.main()"
    )
    program = started(code, "sim:press.toml?seconds=600", tmp_path)
    assert program.stdout is not None and program.stdout.readline() == "spins\n"
    program.send_signal(how)
    _, errors = program.communicate()
    assert (program.returncode, "Traceback" in errors) == (0, False), errors
