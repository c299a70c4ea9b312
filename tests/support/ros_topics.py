"""The ROS 2 messages of an MCAP file, as rosbags reads them with ROS' own definitions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from rosbags.typesys import Stores, get_typestore

STORE = get_typestore(Stores.ROS2_HUMBLE)


def messages_of(path: Path, topic: str) -> list[tuple[int, int, Any]]:
    """(log time, seq, message) of each."""
    found = []
    with path.open("rb") as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages(topics=[topic]):
            assert schema is not None and (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
            found.append((message.log_time, message.sequence, STORE.deserialize_cdr(message.data, schema.name)))
    return found
