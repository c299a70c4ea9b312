"""Messages of a ROS bag, of ROS 1 or ROS 2."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag2 import Reader as Reader2

from ..errors import BiotacError, InputError
from .message import Message, RefusedError
from .ros import Decode, decoder, is_known


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """rosbags' reader of a bag, of ROS 1 by its suffix. Raises InputError for one that cannot be read."""
    try:
        with Reader1(path) if path.suffix == ".bag" else Reader2(path) as bag:
            yield bag
    except BiotacError:
        raise
    except Exception as error:  # rosbags raises what it finds
        raise InputError(f"{path} cannot be read as a ROS bag ({error}); copy it again") from error


class Bag:
    """A topic of a bag: the only one with BioTacs, or ``topic``. Raises InputError for any other."""

    live = False

    def __init__(self, path: Path, topic: str) -> None:
        if not path.exists():
            raise InputError(f"{path} does not exist; expected a ROS 1 .bag, or the folder of a ROS 2 bag")
        self._path = path
        self._ros1 = path.suffix == ".bag"
        with opened(self._path) as bag:
            found = [c for c in bag.connections if is_known(c.msgtype) and topic in ("", c.topic)]
            topics = sorted({c.topic for c in found})
            if len(topics) != 1:
                seen = ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in (found or bag.connections)}))
                wanted = f"topic {topic}" if topic else "one topic with BioTacs"
                wanted = f"{path}: expected {wanted} of BiotacAll or BioTacHand"
                raise InputError(f"{wanted}, it has {seen}; name one: ?topic=")
            try:
                self._decode: dict[Any, Decode] = {c.id: self._decoder(c) for c in found}
            except RefusedError as error:
                raise InputError(f"{path}: {error}") from error
            self._ids = set(self._decode)

    def _decoder(self, connection: Any) -> Decode:
        text = connection.msgdef.data
        if not text:
            raise RefusedError(f"no definition of {connection.msgtype} in the bag; record it again with mcap storage")
        return decoder(connection.msgtype, text, ros1=self._ros1, idl=connection.msgdef.format.name == "IDL")

    def __iter__(self) -> Iterator[Message | RefusedError]:
        with opened(self._path) as bag:
            chosen = [c for c in bag.connections if c.id in self._ids]
            for connection, logged_ns, raw in bag.messages(connections=chosen):
                try:
                    yield self._decode[connection.id](bytes(raw), logged_ns)
                except RefusedError as error:
                    yield error
