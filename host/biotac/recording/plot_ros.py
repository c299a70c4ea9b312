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
FLAGS = "std_msgs/msg/UInt32"
LOG = "rcl_interfaces/msg/Log"
INFO, WARN = 20, 30  # levels of a log
_LAST_S = 2**31 - 1  # that ROS's time can say, in 2038
_RULE = "=" * 80 + "\n"
_TIME = f"{_RULE}MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"

#: ROS 2 message definitions by type name.
SCHEMAS = {
    ARRAY: f"""std_msgs/MultiArrayLayout layout
float64[] data
{_RULE}MSG: std_msgs/MultiArrayLayout
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
{_RULE}MSG: std_msgs/MultiArrayDimension
string label
uint32 size
uint32 stride
""",
    POSE: f"""std_msgs/Header header
geometry_msgs/Pose pose
{_RULE}MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{_TIME}{_RULE}MSG: geometry_msgs/Pose
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
{_RULE}MSG: geometry_msgs/Point
float64 x
float64 y
float64 z
{_RULE}MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
""",
    FLAGS: "uint32 data\n",
    LOG: f"""byte DEBUG=10
byte INFO=20
byte WARN=30
byte ERROR=40
byte FATAL=50
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
{_TIME}""",
}


def array(label: str, values: Any) -> bytes:
    """A Float64MultiArray of ``values`` (n,), NaN where one is invalid; ``label`` says what they are."""
    n = len(values)
    return _cdr(1, label, n, n, 0, n, np.asarray(values, np.float32))


def flags(value: int) -> bytes:
    """A UInt32."""
    return _cdr(value)


def contact(finger: int, poc_m: Any, force_n: Any, stamp_ns: int) -> bytes:
    """A PoseStamped at the point of contact, its x axis along the force (the finger's own x where there is none)."""
    pose = np.array([*poc_m, *_turned_to(force_n)], np.float32)
    return _cdr(*_time(stamp_ns), layout.frame_id(finger), pose)


def log(name: str, text: str, stamp_ns: int, level: int = INFO) -> bytes:
    """A Log of ``text``, said by ``name``."""
    return _cdr(*_time(stamp_ns), bytes([level]), name, text, "", "", 0)


def _time(stamp_ns: int) -> tuple[int, int]:
    seconds, ns = divmod(stamp_ns, 10**9)
    return min(seconds, _LAST_S), ns


def _cdr(*fields: int | str | bytes | Any) -> bytes:
    """uint32, string, octets, or an array of float64 from float32."""
    out = bytearray()
    for field in fields:
        if isinstance(field, bytes):
            out += field
        elif isinstance(field, str):
            text = field.encode() + b"\0"
            out += bytes(-len(out) % 4) + struct.pack("<I", len(text)) + text
        elif isinstance(field, int):
            out += bytes(-len(out) % 4) + struct.pack("<I", field)
        else:
            out += bytes(-len(out) % 8) + field.astype("<f8").tobytes()
    return b"\0\1\0\0" + bytes(out)


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
