"""References as geometry_msgs WrenchStamped in an MCAP file: ROS 2 bags (CDR) or JSON, as Foxglove writes it.

ROS fixes the units, N and N m (REP 103), and the message has its own stamp, so nothing is guessed.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from mcap.reader import make_reader

from ...documents import parse_json
from ...errors import BiotacError, RecordingError, imported
from .mounting import Mounting
from .samples import Reference, Samples, checked

SCHEMAS = ("geometry_msgs/msg/WrenchStamped", "geometry_msgs/WrenchStamped")
NMM_PER_NM = 1000.0

Row = tuple[float, list[float]]


def read_mcap(path: Path, mounting: Mounting | None, topic: str | None = None) -> Reference:
    """The wrench of ``topic``, or of the only wrench topic."""
    if mounting is None:
        raise RecordingError(
            f"{path}: a WrenchStamped does not say how the sensor is mounted on the finger: expected --mounting "
            "FILE.toml, or --mounting lin if axes and origin are already Lin's"
        )
    rows: dict[str, list[Row]] = {}
    decoders: dict[str, Callable[[bytes], Any]] = {}
    seen: set[str] = set()
    try:
        with path.open("rb") as stream:
            for schema, channel, message in make_reader(stream).iter_messages():
                seen.add(f"{channel.topic} ({schema.name if schema else 'no schema'})")
                if schema is None or schema.name not in SCHEMAS or (topic is not None and channel.topic != topic):
                    continue
                if channel.topic not in decoders:
                    decoders[channel.topic] = _decoder(path, channel.message_encoding)
                rows.setdefault(channel.topic, []).append(_row(decoders[channel.topic](message.data)))
    except BiotacError:
        raise
    except Exception as error:  # the packages that read it raise many kinds of errors for a damaged file
        raise RecordingError(f"{path}: cannot be read ({error}): expected an MCAP file with {SCHEMAS[0]}") from None
    if len(rows) != 1:
        known = ", ".join(sorted(rows)) or ", ".join(sorted(seen)[:6]) or "no messages"
        cure = "name one: --reference FILE:TOPIC" if rows else "record the sensor's topic too"
        raise RecordingError(f"{path}: holds {known}: expected one topic of {SCHEMAS[0]}; {cure}")
    ((name, stamped),) = rows.items()
    stamped.sort(key=lambda row: row[0])  # a bag is in order of arrival, not of the sensor's stamps
    samples = Samples(np.array([t for t, _ in stamped]), np.array([w for _, w in stamped]))
    return Reference(path.name, checked(f"{path} {name}", samples), mounting, name)


def _decoder(path: Path, encoding: str) -> Callable[[bytes], Any]:
    """A function from a message's bytes to an object with its fields as attributes."""
    if encoding == "json":
        return lambda data: parse_json(data, lambda fields: SimpleNamespace(**fields))
    if encoding != "cdr":
        raise RecordingError(f"{path}: messages are {encoding!r}: expected json or cdr (ROS 2); convert the bag")
    types = imported("rosbags.typesys", f"{path}, a ROS 2 bag,", "export")
    store = types.get_typestore(types.Stores.ROS2_HUMBLE)
    return lambda data: store.deserialize_cdr(data, SCHEMAS[0])


def _row(message: Any) -> Row:
    stamp, wrench = message.header.stamp, message.wrench
    # ROS 2 has sec and nanosec, Foxglove's JSON sec and nsec, ROS 1 secs and nsecs.
    second = stamp.sec if hasattr(stamp, "sec") else stamp.secs
    nanosec = next(getattr(stamp, name) for name in ("nanosec", "nsec", "nsecs") if hasattr(stamp, name))
    force, torque = ([float(getattr(vector, axis)) for axis in "xyz"] for vector in (wrench.force, wrench.torque))
    return float(second) + float(nanosec) * 1e-9, [*force, *[NMM_PER_NM * t for t in torque]]
