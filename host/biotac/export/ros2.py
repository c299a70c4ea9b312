"""ROS 2 bag (rosbag2, mcap storage), with standard messages only, so that it plays without our own package."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from ..recording.reader import Recording
from .columns import Show, Table

KINDS_APART = False
_SHOW_ROWS = 1000
_LOG = "rcl_interfaces/msg/Log"
_WARN = 30


def write(place: Path, made: list[Table], recording: Recording, show: Show) -> None:
    """Write a bag with topics ``/biotac/finger0/wrench``, ``poc``, ``flags``, ``counts`` (with PDC, TAC, TDC), ``pac``
    and ``bands``, and ``/biotac/log`` with the gaps.
    """
    total = sum(len(table) for table in made)
    done = 0
    with Writer(place, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        for table in made:
            topics = _Topics(bag, table)
            for row in range(len(table)):
                topics.add(row)
                if row % _SHOW_ROWS == 0:
                    show((done + row) / total)
            done += len(table)
        if recording.gaps:
            store = get_typestore(Stores.ROS2_HUMBLE)
            log = bag.add_connection("/biotac/log", _LOG, typestore=store)
            for gap in recording.gaps:
                text = store.types[_LOG](_time(store.types, gap.back_at_ns), _WARN, "biotac", gap.words(), "", "", 0)
                bag.write(log, gap.back_at_ns, store.serialize_cdr(text, _LOG))


def _time(types: Any, stamp_ns: int) -> Any:
    """ROS 2 counts seconds in 32 bits: after January 2038, header stamps stand still."""
    return types["builtin_interfaces/msg/Time"](min(stamp_ns // 10**9, 2**31 - 1), stamp_ns % 10**9)


class _Topics:
    """One finger's connections."""

    def __init__(self, bag: Any, table: Table) -> None:
        self._bag = bag
        self._table = table
        self._store = get_typestore(Stores.ROS2_HUMBLE)
        self._types = self._store.types
        kinds = {
            "frames": {
                "wrench": "geometry_msgs/msg/WrenchStamped",
                "poc": "geometry_msgs/msg/PointStamped",
                "flags": "std_msgs/msg/UInt32",
                "counts": "std_msgs/msg/UInt16MultiArray",
            },
            "pac": {"pac": "std_msgs/msg/UInt16MultiArray"},
            "bands": {"bands": "std_msgs/msg/Float64MultiArray"},
        }[table.kind]
        self._connections = {
            name: (bag.add_connection(f"/biotac/finger{table.finger}/{name}", kind, typestore=self._store), kind)
            for name, kind in kinds.items()
        }
        columns = ("stamp_ns", *(("force_n", "torque_nmm", "poc_mm", "flags") if table.kind == "frames" else ()))
        # REP 103 asks for m and N*m
        self._lists = {
            name: (table.arrays[name] / 1000 if name.endswith("mm") else table.arrays[name]).tolist()
            for name in columns
        }
        listed = {"frames": ("counts", "pdc", "tac", "tdc"), "pac": ("pac",), "bands": ("energy_count2",)}[table.kind]
        self._numbers = np.column_stack([table.arrays[name] for name in listed])

    def add(self, row: int) -> None:
        """Write all messages of one row."""
        stamp_ns = self._lists["stamp_ns"][row]
        if self._table.kind != "frames":
            self._write(self._table.kind, stamp_ns, self._array(self._table.kind, row))
            return
        header = self._make(
            "std_msgs/msg/Header",
            _time(self._types, stamp_ns),
            self._table.frame_id,
        )
        force, torque = (
            self._make("geometry_msgs/msg/Vector3", *self._lists[n][row]) for n in ("force_n", "torque_nmm")
        )
        wrench = self._make("geometry_msgs/msg/Wrench", force, torque)
        self._write("wrench", stamp_ns, self._make("geometry_msgs/msg/WrenchStamped", header, wrench))
        point = self._make("geometry_msgs/msg/Point", *self._lists["poc_mm"][row])
        self._write("poc", stamp_ns, self._make("geometry_msgs/msg/PointStamped", header, point))
        self._write("flags", stamp_ns, self._make("std_msgs/msg/UInt32", self._lists["flags"][row]))
        self._write("counts", stamp_ns, self._array("counts", row))

    def _make(self, name: str, *values: Any) -> Any:
        return self._types[name](*values)

    def _array(self, name: str, row: int) -> Any:
        layout = self._make("std_msgs/msg/MultiArrayLayout", [], 0)
        return self._make(self._connections[name][1], layout, self._numbers[row])

    def _write(self, name: str, stamp_ns: int, message: Any) -> None:
        connection, kind = self._connections[name]
        self._bag.write(connection, stamp_ns, self._store.serialize_cdr(message, kind))
