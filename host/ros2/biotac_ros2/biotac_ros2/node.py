"""A board's fingers as topics: wrench, point of contact and flags of each, in SI units.

ros2 run biotac_ros2 node --ros-args -p port:=/dev/ttyACM0
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
import rclpy
from geometry_msgs.msg import PointStamped, WrenchStamped
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray, String, UInt8, UInt32
from std_srvs.srv import Trigger

import biotac
from biotac.clock.stamps import Stamps
from biotac.hand.silence import LOOK_S, Silence
from biotac.recording.layout import frame_id

#: Reliable, so that every subscriber's quality of service fits; half a second of rounds.
DEPTH = 50
GRIP = ("normal_n", "normal_half_n", "shear_n", "shear_half_n")


class Fingers(Node):
    """Opens the board of the parameter ``port`` (as biotac.open; empty: the only one on USB) and publishes it.

    Names, frames and values are those of `biotac export REC OUT.ros2`.

    ``biotac/finger0/wrench`` WrenchStamped in N and N*m, on the finger, about the origin of ``biotac_finger0``;
    ``biotac/finger0/poc`` PointStamped in m; ``biotac/finger0/grip`` Float64MultiArray: normal, its half width, shear,
    its half width, in N; ``biotac/finger0/flags`` UInt32 (flags frame of MESSAGES.md); ``biotac/finger0/trust`` UInt8
    (enum trust); ``biotac/finger0/slip`` UInt8, the slip_level: 0 where it does not slip, 255 where unknown;
    ``biotac/finger0/event`` String, an event's kind (EventKind: SLIP, ...) as soon as it arrives. Invalid values are
    NaN, never old ones: check for them before a controller acts. A finger that had frames and has had none for 0.1 s is
    NaN once, of trust NONE. Topics begin with a finger's first row. Stamps are the begin of the round on this node's
    clock. Service ``biotac/tare``, a Trigger: tares every finger now.
    """

    def __init__(self) -> None:
        super().__init__("biotac")
        self.declare_parameter("port", "")
        # A simulated board in real time; others have no pace.
        self.hand = hand = biotac.open(self.get_parameter("port").value or None, pace=1.0)
        hand.stream("results", "events")
        self._stamps = Stamps(hand, lambda: self.get_clock().now().nanoseconds / 1e9)
        self._silence = Silence()
        self._topics: dict[int, dict[str, Any]] = {}
        for finger in hand.fingers:
            self._of(finger)
        self.create_service(Trigger, "biotac/tare", self.tare)

    def publish(self, batch: Any) -> None:
        """All frames of a batch. Raises DeviceLostError when the board no longer answers."""
        self._stamps.keep()
        for message in batch.messages:
            if isinstance(message, biotac.Event) and message.kind in list(biotac.EventKind):
                kind_text = String(data=biotac.EventKind(message.kind).name)
                self._of(message.finger)["event"].publish(kind_text)
        first = self._stamps.by_arrival == 0
        self._publish_all(batch.frames)
        self._publish_all(self._silence.rows(batch))
        if first and self._stamps.by_arrival:
            self.get_logger().warning("the board's clock is not known yet: frames are stamped on arrival")

    def _of(self, finger: int) -> dict[str, Any]:
        """The publishers of a finger, made when it first appears."""
        if finger not in self._topics:
            kinds = {"wrench": WrenchStamped, "poc": PointStamped, "grip": Float64MultiArray, "event": String}
            kinds |= {"flags": UInt32, "trust": UInt8, "slip": UInt8}
            self._topics[finger] = {
                name: self.create_publisher(kind, f"biotac/finger{finger}/{name}", DEPTH)
                for name, kind in kinds.items()
            }
        return self._topics[finger]

    def _publish_all(self, frames: Any) -> None:
        stamps_s = np.empty(len(frames))
        for finger in np.unique(frames["finger"]).tolist():
            rows = frames["finger"] == finger
            stamps_s[rows] = self._stamps.of(frames["t_us"][rows].astype(np.float64), finger)
        for row, stamp_s in zip(frames, stamps_s.tolist(), strict=True):
            self._publish(row, round(stamp_s * 1e9))

    def _publish(self, row: Any, stamp_ns: int) -> None:
        finger = int(row["finger"])
        topics = self._of(finger)
        wrench, point = WrenchStamped(), PointStamped()
        for header in (wrench.header, point.header):
            header.stamp.sec, header.stamp.nanosec = divmod(stamp_ns, 10**9)
            header.frame_id = frame_id(finger)
        fill(wrench.wrench.force, row["force_n"])
        fill(wrench.wrench.torque, row["torque_nmm"] / 1000.0)
        fill(point.point, row["poc_mm"] / 1000.0)
        topics["wrench"].publish(wrench)
        topics["poc"].publish(point)
        topics["grip"].publish(Float64MultiArray(data=[float(row[name]) for name in GRIP]))
        topics["flags"].publish(UInt32(data=int(row["flags"])))
        topics["trust"].publish(UInt8(data=int(row["trust"])))
        topics["slip"].publish(UInt8(data=int(row["slip_level"])))

    def tare(self, request: Any, response: Any) -> Any:
        """Tare every finger; the message names those that could not be tared, and why."""
        refused = []
        for finger in self.hand.fingers:
            try:
                self.hand.tare(finger)
            except biotac.CommandRefusedError as error:
                refused.append(f"finger {finger}: {error}")
        response.success = not refused
        response.message = "; ".join(refused) or "tared"
        return response


def fill(vector: Any, values: Any) -> None:
    """Three numbers into x, y and z; ROS wants Python's own floats."""
    vector.x, vector.y, vector.z = (float(value) for value in values)


def spin(node: Fingers) -> None:
    """Publish until the source ends or ROS shuts down. One thread has board and node: a Hand is for one."""
    for batch in node.hand.batches(LOOK_S):
        if not rclpy.ok():
            return
        node.publish(batch)
        rclpy.spin_once(node, timeout_sec=0.0)


def main() -> None:
    """The node, until Ctrl-C or SIGTERM. Without a board it ends with one line and the command line's exit code."""
    rclpy.init()
    node = None
    try:
        node = Fingers()
        spin(node)
    except KeyboardInterrupt:
        pass  # the usual way to stop it
    except biotac.BiotacError as error:
        print(f"biotac: {error}", file=sys.stderr)
        raise SystemExit(error.exit_code) from None
    except Exception:
        # A signal shuts ROS down at any moment, and then whatever is asked of it raises something.
        if rclpy.ok():
            raise
    finally:
        if node is not None:
            node.hand.close()
        rclpy.try_shutdown()
