"""ROS 2 messages of a recording, for programs that draw well-known types without setup: Foxglove, PlotJuggler, Rerun.

Encoded as little-endian CDR, every field aligned to its own size after the four bytes of encapsulation. Numbers are
float64, as these programs expect, rounded to float32: the zero bytes make a recording smaller.
"""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np

from . import layout

ARRAY = "std_msgs/msg/Float64MultiArray"
POSE = "geometry_msgs/msg/PoseStamped"
_RULE = "=" * 80
_CDR = b"\0\1\0\0"

#: ROS 2 message definitions by type name.
SCHEMAS = {
    ARRAY: f"""std_msgs/MultiArrayLayout layout
float64[] data
{_RULE}
MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
{_RULE}
MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
""",
    POSE: f"""std_msgs/Header header
geometry_msgs/Pose pose
{_RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
{_RULE}
MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
{_RULE}
MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
{_RULE}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
""",
}


def array(label: str, values: Any) -> bytes:
    """A Float64MultiArray of ``values`` (n,), NaN where one is invalid; ``label`` says what they are."""
    n = len(values)
    text = label.encode() + b"\0"
    head = struct.pack("<II", 1, len(text)) + text + bytes(-len(text) % 4) + struct.pack("<IIII", n, n, 0, n)
    return _CDR + head + bytes(-len(head) % 8) + _numbers(values)


def contact(finger: int, poc_m: Any, force_n: Any, stamp_ns: int) -> bytes:
    """A PoseStamped at the point of contact, its x axis along the force (the finger's own x where there is none)."""
    text = layout.frame_id(finger).encode() + b"\0"
    seconds, ns = divmod(stamp_ns, 10**9)
    head = struct.pack("<iII", min(seconds, 2**31 - 1), ns, len(text)) + text
    return _CDR + head + bytes(-len(head) % 8) + _numbers([*poc_m, *_turned_to(force_n)])


def _numbers(values: Any) -> bytes:
    return np.asarray(values, np.float32).astype("<f8").tobytes()


def _turned_to(force_n: Any) -> tuple[float, float, float, float]:
    """The shortest rotation from x to ``force_n``, as a quaternion x, y, z, w; none for a zero or invalid force."""
    x, y, z = (float(value) for value in force_n)
    size = math.sqrt(x * x + y * y + z * z)
    if not size > 0:  # none, or NaN
        return 0.0, 0.0, 0.0, 1.0
    w = math.sqrt((1 + x / size) / 2)
    if w < 1e-6:  # opposite direction: half a turn about any axis normal to x
        return 0.0, 0.0, 1.0, 0.0
    return 0.0, -z / size / (2 * w), y / size / (2 * w), w
