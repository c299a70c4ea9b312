"""rclpy as far as our node uses it; test_ros2_real.py has the real one. Its messages are ROS 2 Humble's definitions.

The messages come from rosbags: a field that does not exist raises, and what is published is serialised to CDR
and back, so a value that ROS would not carry raises too. What the real executor, QoS and discovery do is not here.
"""

from __future__ import annotations

import sys
import types
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)
USED = (
    "geometry_msgs/msg/PointStamped",
    "geometry_msgs/msg/WrenchStamped",
    "std_msgs/msg/String",
    "std_msgs/msg/UInt8",
    "std_msgs/msg/Float64MultiArray",
    "std_msgs/msg/UInt32",
)


@dataclass
class Ros:
    """What happened to the fake."""

    now_ns: int = 0
    parameters: dict[str, Any] = field(default_factory=dict)
    published: list[tuple[str, Any]] = field(default_factory=list)
    services: dict[str, Callable[[Any, Any], Any]] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)
    spins: int = 0
    ok_for_spins: float = float("inf")
    up: bool = False


def blank(kind: str) -> Any:
    """A message with ROS' defaults, and no room for other fields."""
    values = {}
    for name, (kind_of_field, detail) in STORE.fielddefs[kind][1]:
        value = blank(detail) if kind_of_field.name == "NAME" else {"string": "", "float64": 0.0}.get(detail[0], 0)
        values[name] = [] if kind_of_field.name == "SEQUENCE" else value
    maker = type(kind.rsplit("/", 1)[1], (), {"__slots__": (*values, "_kind")})
    message = maker()
    message._kind = kind
    for name, value in values.items():
        setattr(message, name, value)
    return message


def solid(message: Any) -> Any:
    """As rosbags' own message, which it can serialise."""
    if not hasattr(message, "_kind"):
        return np.array(message) if isinstance(message, list) and message else message
    names = [name for name in message.__slots__ if name != "_kind"]
    return STORE.types[message._kind](*(solid(getattr(message, name)) for name in names))


def install(monkeypatch: Any, ros: Ros) -> None:
    """Put the fake where the node imports from."""

    class Publisher:
        def __init__(self, topic: str, kind: Any) -> None:
            self.topic, self.kind = topic, kind

        def publish(self, message: Any) -> None:
            assert message._kind == self.kind, f"{self.topic} carries {self.kind}, not {message._kind}"
            raw = STORE.serialize_cdr(solid(message), self.kind)
            ros.published.append((self.topic, STORE.deserialize_cdr(raw, self.kind)))

    class Node:
        def __init__(self, name: str) -> None:
            assert ros.up, "a node before rclpy.init()"

        def declare_parameter(self, name: str, default: Any) -> None:
            ros.parameters.setdefault(name, default)

        def get_parameter(self, name: str) -> Any:
            return types.SimpleNamespace(value=ros.parameters[name])

        def create_publisher(self, kind: Any, topic: str, depth: int) -> Publisher:
            return Publisher(topic, kind.kind)

        def create_service(self, kind: Any, name: str, answer: Callable[[Any, Any], Any]) -> None:
            ros.services[name] = answer

        def get_clock(self) -> Any:
            return types.SimpleNamespace(now=lambda: types.SimpleNamespace(nanoseconds=ros.now_ns))

        def get_logger(self) -> Any:
            return types.SimpleNamespace(warning=ros.warnings.append)

    def spin_once(node: Any, timeout_sec: float) -> None:
        ros.spins += 1

    def put(name: str, **members: Any) -> None:
        module = types.ModuleType(name)
        module.__dict__.update(members)
        monkeypatch.setitem(sys.modules, name, module)

    put(
        "rclpy",
        init=lambda: setattr(ros, "up", True),
        ok=lambda: ros.spins < ros.ok_for_spins,
        spin_once=spin_once,
        try_shutdown=lambda: setattr(ros, "up", False),
    )
    put("rclpy.node", Node=Node)
    for package in ("geometry_msgs", "std_msgs"):
        put(package)
        put(f"{package}.msg", **{k.rsplit("/", 1)[1]: maker_of(k) for k in USED if k.startswith(package)})
    put("std_srvs")
    put("std_srvs.srv", Trigger=types.SimpleNamespace())


def maker_of(kind: str) -> Any:
    """Stands for a message class: called, it makes one."""

    def make(**values: Any) -> Any:
        message = blank(kind)
        for name, value in values.items():
            setattr(message, name, value)
        return message

    make.kind = kind  # type: ignore[attr-defined]
    return make
