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
#: Fields of the types that messages are made of.
_FIELDS = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride\n",
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n",
}


def _definition(fields: str, *parts: str) -> str:
    return fields + "".join(f"{'=' * 80}\nMSG: {part}\n{_FIELDS[part]}" for part in parts)


_LEVELS = "byte DEBUG=10\nbyte INFO=20\nbyte WARN=30\nbyte ERROR=40\nbyte FATAL=50\n"
_LOG_FIELDS = "uint8 level\nstring name\nstring msg\nstring file\nstring function\nuint32 line\n"
_ARRAY_PARTS = ("std_msgs/MultiArrayLayout", "std_msgs/MultiArrayDimension")
_HEADER_PARTS = ("std_msgs/Header", "builtin_interfaces/Time")
_POSE_PARTS = ("geometry_msgs/Pose", "geometry_msgs/Point", "geometry_msgs/Quaternion")
#: ROS 2 message definitions by type name.
SCHEMAS = {
    ARRAY: _definition("std_msgs/MultiArrayLayout layout\nfloat64[] data\n", *_ARRAY_PARTS),
    POSE: _definition("std_msgs/Header header\ngeometry_msgs/Pose pose\n", *_HEADER_PARTS, *_POSE_PARTS),
    FLAGS: _definition("uint32 data\n"),
    LOG: _definition(f"{_LEVELS}builtin_interfaces/Time stamp\n{_LOG_FIELDS}", "builtin_interfaces/Time"),
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
    return _cdr(*time(stamp_ns), layout.frame_id(finger), pose)


def log(name: str, text: str, stamp_ns: int, level: int = INFO) -> bytes:
    """A Log of ``text``, said by ``name``."""
    return _cdr(*time(stamp_ns), bytes([level]), name, text, "", "", 0)


def time(stamp_ns: int) -> tuple[int, int]:
    """Seconds and ns of a stamp. ROS 2 counts seconds in 32 bits: after January 2038, they stand still."""
    seconds, ns = divmod(stamp_ns, 10**9)
    return min(seconds, 2**31 - 1), ns


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
