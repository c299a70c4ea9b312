"""A robot's topic by the bridge that ROS 1 and ROS 2 both have, foxglove_bridge: it sends each topic's definition."""

from __future__ import annotations

import json
import socket
import struct
import sys
import time
from collections.abc import Iterator
from typing import Any

import websocket

from ...errors import PortError
from .message import Message, RefusedError
from .ros import Decode, decoder, is_known

WAIT_S = 0.002  # for a message; then the board answers its host
CONNECT_S = 5.0
AGAIN_S = 1.0
PROTOCOLS = ["foxglove.sdk.v1", "foxglove.websocket.v1"]
_DATA = struct.Struct("<BIQ")  # 1, subscription, when it was logged in ns


class Foxglove:
    """``topic`` of the bridge at ``host``, or the only one there with BioTacs."""

    live = True

    def __init__(self, port: str, host: str, topic: str) -> None:
        self._port, self._host, self._topic = port, host, topic
        self._is_named = bool(topic)
        self._seen: dict[int, str] = {}  # other channels
        self._channel: int | None = None
        self._subscriptions = 0
        self._decode: Decode | None = None
        self._received_s = 0.0

    def __iter__(self) -> Iterator[Message | RefusedError | str | None]:
        try:
            bridge = websocket.create_connection(f"ws://{self._host}", subprotocols=PROTOCOLS, timeout=CONNECT_S)
        except Exception as error:  # of sockets, of HTTP, of names
            cure = "start foxglove_bridge there, and check the address"
            raise PortError(f"{self._port}: no foxglove_bridge answers at {self._host} ({error}); {cure}") from error
        try:
            bridge.settimeout(WAIT_S)
            while True:
                try:
                    kind, data = bridge.recv_data()
                except websocket.WebSocketTimeoutException:
                    if self._decode is not None and time.monotonic() - self._received_s > AGAIN_S:
                        self._ask(bridge)
                    yield None
                    continue
                if kind == websocket.ABNF.OPCODE_TEXT:
                    yield self._receive(bridge, data)
                elif kind == websocket.ABNF.OPCODE_BINARY and len(data) >= _DATA.size and data[0] == 1:
                    _, subscription, logged_ns = _DATA.unpack_from(data)
                    if self._decode is not None and subscription == self._subscriptions:
                        self._received_s = time.monotonic()
                        _acknowledge(bridge)
                        try:
                            yield self._decode(data[_DATA.size :], logged_ns)
                        except RefusedError as error:
                            yield error
        finally:
            self._channel = self._decode = None
            bridge.close()

    def _receive(self, bridge: Any, data: bytes) -> RefusedError | str | None:
        """Subscribe to the topic whenever it is advertised, as after a change of its definition."""
        try:
            advert = json.loads(data)
            channels = advert["channels"] if advert.get("op") == "advertise" else []
            known = sorted({own["topic"] for own in channels if is_known(own["schemaName"])})
            if not self._topic and len(known) > 1:
                cure = f"name one: foxglove://{self._host}{known[0]}"
                raise PortError(f"{self._port}: expected one topic with BioTacs, it has {' and '.join(known)}; {cure}")
            for own in channels:
                topic, kind = own["topic"], own["schemaName"]
                if is_known(kind) and self._topic in ("", topic):
                    self._subscribe(bridge, own)
                else:
                    self._seen[own["id"]] = f"{topic} ({kind})"
        except RefusedError as error:
            return error
        except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
            return RefusedError(f"what is no advertisement ({error})")
        others = "" if self._is_named else " and ".join(topic for topic in known if topic != self._topic)
        if channels and others:
            return f"{others} came after {self._topic}, and is not read"
        if channels and self._channel is None:
            return RefusedError(
                f"no topic {self._topic or 'of BiotacAll or BioTacHand'}, but {', '.join(self._seen.values())}"
            )
        return None

    def _subscribe(self, bridge: Any, own: dict[str, Any]) -> None:
        self._topic = self._topic or own["topic"]
        self._decode, self._channel = None, own["id"]
        idl = own.get("schemaEncoding") == "ros2idl"
        self._decode = decoder(own["schemaName"], own["schema"], ros1=own["encoding"] == "ros1", idl=idl)
        self._ask(bridge)

    def _ask(self, bridge: Any) -> None:
        """Again after a silence: a bridge that has just started may not know yet the channel that it advertised."""
        bridge.send(json.dumps({"op": "unsubscribe", "subscriptionIds": [self._subscriptions]}))
        self._subscriptions, self._received_s = self._subscriptions + 1, time.monotonic()
        subscription = {"id": self._subscriptions, "channelId": self._channel}
        bridge.send(json.dumps({"op": "subscribe", "subscriptions": [subscription]}))


def _acknowledge(bridge: Any) -> None:
    """Tell the bridge at once that a message came: one that waits for it sends the next up to 40 ms late (Nagle)."""
    if sys.platform == "linux":
        bridge.sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_QUICKACK, 1)
