"""A ROS 2 bag (rosbag2, mcap storage), its file alone, or a ROS 1 bag, by suffix; of standard messages only."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from ..errors import BiotacError, InputError
from ..recording.reader import Recording
from .bags import is_ros1, opened
from .columns import Show, Table

KINDS_APART = False
BESIDE = True
LOG = "rcl_interfaces/msg/Log"
INFO, WARN = 20, 30  # levels of a log
LOG_1 = "rosgraph_msgs/msg/Log"
LEVELS_1 = {INFO: 2, WARN: 4}  # of a ROS 1 log
_SHOW_ROWS = 1000
_COUNTS = "std_msgs/msg/UInt16MultiArray"
_NUMBERS = "std_msgs/msg/Float64MultiArray"
_GRIP = ("normal_n", "normal_half_n", "shear_n", "shear_half_n")
#: By kind of table: the topics, with their types.
_TOPICS = {
    "frames": {
        "wrench": "geometry_msgs/msg/WrenchStamped",
        "poc": "geometry_msgs/msg/PointStamped",
        "grip": _NUMBERS,
        "flags": "std_msgs/msg/UInt32",
        "trust": "std_msgs/msg/UInt8",
        "slip": "std_msgs/msg/UInt8",
        "counts": _COUNTS,
    },
    "pac": {"pac": _COUNTS},
    "bands": {"bands": _NUMBERS},
}


def write(path: Path, made: list[Table], recording: Recording, show: Show, *, beside: Path | None = None) -> None:
    """Write a bag, with ``beside``'s messages if it is given: topics ``/biotac/finger0/wrench``, ``poc``, ``grip``
    (normal, its half width, shear, its half width, in N), ``flags``, ``trust``, ``slip`` (the slip_level),
    ``counts`` (with PDC, TAC, TDC), ``pac`` and ``bands``, and ``/biotac/log`` with gaps and labels.
    """
    if path.suffix != ".mcap":
        _write(path, made, recording, show, beside)
        return
    with TemporaryDirectory(dir=path.parent, prefix=f"{path.name}.") as folder:
        _write(Path(folder) / "bag", made, recording, show, beside)
        (file,) = Path(folder).glob("bag/*.mcap")
        file.replace(path)


def _write(path: Path, made: list[Table], recording: Recording, show: Show, beside: Path | None) -> None:
    ros1 = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
    serialize, log_kind = (store.serialize_ros1, LOG_1) if ros1 else (store.serialize_cdr, LOG)
    total = sum(len(table) for table in made)
    done = 0
    with Writer1(path) if ros1 else Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        if beside is not None:
            try:
                _copy(beside, bag, ros1, store)
            except _WriterError as error:
                raise error.__cause__ or error from None

        def topic(name: str, kind: str) -> Callable[[int, Any], None]:
            connection = bag.add_connection(f"/biotac/{name}", kind, typestore=store)
            return lambda stamp_ns, message: bag.write(connection, stamp_ns, serialize(message, kind))

        for table in made:
            topics = {name: topic(f"finger{table.finger}/{name}", kind) for name, kind in _TOPICS[table.kind].items()}
            for stamp_ns, messages in _messages(table, store.types):
                for name, message in messages.items():
                    topics[name](stamp_ns, message)
                if done % _SHOW_ROWS == 0:
                    show(done / total)
                done += 1
        begin_us = recording.begin_us
        at_ns = recording.stamp_ns(
            np.array([max(label.t_us or begin_us, begin_us) for label in recording.labels], np.int64)
        ).tolist()
        logged = [(ns, INFO, label.line()) for ns, label in zip(at_ns, recording.labels, strict=True)]
        ends_us = [gap.next_t_us or gap.last_t_us or begin_us for gap in recording.gaps]
        ends_ns = recording.stamp_ns(np.array(ends_us, np.int64)).tolist()
        logged += [(ns, WARN, gap.line()) for ns, gap in zip(ends_ns, recording.gaps, strict=True)]
        log = topic("log", log_kind) if logged else lambda stamp_ns, message: None
        for stamp_ns, level, text in logged:
            if ros1:
                entry: Any = (_header(store.types, stamp_ns, ""), LEVELS_1[level], "biotac", text, "", "", 0, [])
            else:
                entry = (_time(store.types, stamp_ns), level, "biotac", text, "", "", 0)
            log(stamp_ns, store.types[log_kind](*entry))


def _copy(source: Path, bag: Any, ros1: bool, store: Any) -> None:
    """All messages of the bag ``source``. Raises InputError for one that cannot be read, or of the other ROS."""
    if is_ros1(source) != ros1:
        raise InputError(f"{source} is no bag of ROS {1 if ros1 else 2}: name the output {'.ros2' if ros1 else '.bag'}")
    with opened(source) as reader:
        if results := [c.topic for c in reader.connections if re.match("/biotac/(finger|log)", c.topic)]:
            raise InputError(f"{source} has results already ({results[0]}); expected the bag that the robot recorded")
        made = {c.id: (c.topic, c.msgtype, _as_there(source, c, ros1, store)) for c in reader.connections}
        try:
            to = {k: bag.add_connection(topic, kind, **how) for k, (topic, kind, how) in made.items()}
        except Exception as error:
            raise _WriterError from error
        for connection, logged_ns, raw in reader.messages():
            try:
                bag.write(to[connection.id], logged_ns, raw)
            except Exception as error:
                raise _WriterError from error


class _WriterError(BiotacError):
    """The cause is the writer's own error, not one of the bag that is read."""


def _as_there(source: Path, connection: Any, ros1: bool, store: Any) -> dict[str, Any]:
    """How a topic was recorded: the type's definition and hash, and latching and caller, or QoS.

    What the bag lacks (ROS 2 Humble writes no hashes, and sqlite3 storage no definitions) comes from the definition, or
    from ROS's own types. Raises InputError for a type of which there is none.
    """
    kind, text, digest, own = connection.msgtype, connection.msgdef.data, connection.digest, store
    if not text:
        if kind not in store.fielddefs:
            raise InputError(f"{source} has no definition of {kind} ({connection.topic}); record it with mcap storage")
        text = store.generate_msgdef(kind, ros_version=1 if ros1 else 2)[0]
    if not digest and not ros1:
        own = get_typestore(Stores.ROS2_HUMBLE)
        is_idl = connection.msgdef.format.name == "IDL"
        own.register(get_types_from_idl(text) if is_idl else get_types_from_msg(text, kind))
        digest = own.hash_rihs01(kind)
    ext = connection.ext
    if ros1:
        return {"msgdef": text, "md5sum": digest, "callerid": ext.callerid, "latching": ext.latching}
    return {"msgdef": text, "rihs01": digest, "offered_qos_profiles": ext.offered_qos_profiles}


def _header(types: Any, stamp_ns: int, frame_id: str | None) -> Any:
    kind = types["std_msgs/msg/Header"]
    seq = {"seq": 0} if "seq" in kind.__dataclass_fields__ else {}
    return kind(**seq, stamp=_time(types, stamp_ns), frame_id=frame_id)


def _time(types: Any, stamp_ns: int) -> Any:
    seconds, ns = divmod(stamp_ns, 10**9)  # ROS 2 counts seconds in 32 bits: after January 2038, they stand still
    return types["builtin_interfaces/msg/Time"](min(seconds, 2**31 - 1), ns)


def _messages(table: Table, types: Any) -> Iterator[tuple[int, dict[str, Any]]]:
    """Each row's stamp in ns, and its messages by topic."""
    layout = types["std_msgs/msg/MultiArrayLayout"]([], 0)
    vector, point = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Point"]
    arrays = table.arrays
    stamps_ns = arrays["stamp_ns"].tolist()
    if table.kind != "frames":
        values = arrays["pac" if table.kind == "pac" else "energy_count2"]
        for stamp_ns, row in zip(stamps_ns, values, strict=True):
            yield stamp_ns, {table.kind: types[_TOPICS[table.kind][table.kind]](layout, row)}
        return
    force_n, torque_nm, poc_m = arrays["force_n"], arrays["torque_nmm"] / 1000, arrays["poc_mm"] / 1000  # REP 103
    counts = np.column_stack([arrays[name] for name in ("counts", "pdc", "tac", "tdc")])
    grips = np.column_stack([arrays[name] for name in _GRIP])
    bits = (arrays[name].tolist() for name in ("flags", "trust", "slip_level"))
    lists = stamps_ns, force_n.tolist(), torque_nm.tolist(), poc_m.tolist(), grips, *bits, counts
    for stamp_ns, force, torque, poc, grip, flags, trust, slip, row in zip(*lists, strict=True):
        header = _header(types, stamp_ns, table.frame_id)
        wrench = types["geometry_msgs/msg/Wrench"](vector(*force), vector(*torque))
        yield (
            stamp_ns,
            {
                "wrench": types[_TOPICS["frames"]["wrench"]](header, wrench),
                "poc": types[_TOPICS["frames"]["poc"]](header, point(*poc)),
                "grip": types[_NUMBERS](layout, grip),
                "flags": types[_TOPICS["frames"]["flags"]](flags),
                "trust": types[_TOPICS["frames"]["trust"]](trust),
                "slip": types[_TOPICS["frames"]["slip"]](slip),
                "counts": types[_COUNTS](layout, row),
            },
        )
