"""Messages of a ROS bag, of ROS 1 or ROS 2."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...export.bags import is_ros1, opened
from .message import ALTERNATE_NS, Message, RefusedError
from .ros import Decode, decoder, is_known


class Bag:
    """A topic of a bag: the only one with BioTacs, or ``topic``. Raises InputError for any other."""

    live = False

    def __init__(self, path: Path, topic: str) -> None:
        self._path = path
        self._ros1 = is_ros1(path)
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
            self._topic = topics[0]
            self._ids = set(self._decode)

    def _decoder(self, connection: Any) -> Decode:
        text = connection.msgdef.data
        if not text:
            raise RefusedError(f"no definition of {connection.msgtype} in the bag; record it again with mcap storage")
        return decoder(connection.msgtype, text, ros1=self._ros1, idl=connection.msgdef.format.name == "IDL")

    def __iter__(self) -> Iterator[Message | RefusedError]:
        with opened(self._path) as bag:
            chosen = [c for c in bag.connections if c.id in self._ids]
            seen_ns: dict[Any, int] = {}  # by connection
            last = None
            for connection, logged_ns, raw in bag.messages(connections=chosen):
                if connection.id != last:
                    self._refuse_two(logged_ns - seen_ns.get(connection.id, -(10**18)))
                last = connection.id
                seen_ns[last] = logged_ns
                try:
                    yield self._decode[connection.id](bytes(raw), logged_ns)
                except RefusedError as error:
                    yield error

    def _refuse_two(self, since_ns: int) -> None:
        """A publisher that comes back after another within a second is one of two, of two hands."""
        if since_ns < ALTERNATE_NS:
            raise InputError(
                f"{self._path}: two publishers take turns on {self._topic}, expected one hand a topic; record each "
                "hand on a topic of its own"
            )
