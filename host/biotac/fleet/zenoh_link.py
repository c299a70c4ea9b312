"""``zenoh:NAME``: a board that another computer shares."""

from __future__ import annotations

import math
import os
import secrets
import socket
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from ..errors import CommandRefusedError, DeviceLostError, PortError
from ..link.base import Played
from ..link.port_text import options_of
from ..wire import messages_gen as wire
from ..wire.framing import encode, open_frame
from . import network, rights

FORM = "zenoh:NAME?connect=tcp/HOST:7447&write=yes&config=FILE"
MAX_WAITING_BYTES = 4 << 20  # of batches that nobody reads; about half a minute of five fingers
REPLAYED, FOREIGN = 1 << 12, 1 << 32  # batches back, or ahead, of the one that is due
ANSWER_S = 1.0
# Whose connection was cut, or who was stopped for as long as Zenoh waits, finds the same board again by itself.
GONE_S = 1.0


@dataclass(frozen=True)
class ZenohPort:
    """A parsed ``zenoh:NAME?...``."""

    name: str
    connect: str | None
    config: str | None
    write: bool


def parse_zenoh(port: str) -> ZenohPort:
    """Raises PortError."""
    name, options = options_of(port, ("connect", "config", "write"), FORM)
    if not network.NAME.fullmatch(name) or options.get("write", "yes") not in ("yes", "no"):
        raise PortError(f"{port}: expected {FORM}; `biotac list --zenoh` lists names")
    return ZenohPort(name, options.get("connect"), options.get("config"), options.get("write") == "yes")


def open_zenoh(port: str, pace: float) -> ZenohLink:
    """Open a zenoh: port; its time is its own, whatever ``pace`` is. Raises PortError or InputError."""
    return ZenohLink(port, parse_zenoh(port))


class ZenohLink:
    """A byte pipe to a shared board. A reader, unless its port says ``write=yes``, of which there is one at a time.

    What would change the board raises CommandRefusedError for readers. ``batches_lost`` counts what this side was too
    slow for: whole batches, which are also lost frames to whoever counts those.
    """

    patience = 2.0  # its answers come through a second program
    keeps_time = True
    bits_per_s: int | None = None

    def __init__(self, port: str, its: ZenohPort) -> None:
        self.port = port
        self.source: Played | None = None
        self.ended = False
        self.pace = 1.0
        self.fd: int | None = None
        self.batches_lost = 0
        self._its = its
        self._session: Any = None
        self._secret = b""
        self._came = threading.Condition()
        self._batches: deque[bytes] = deque()
        self._waiting = 0  # bytes
        self._next: int | None = None
        self._started = False
        self._gone_s = math.inf  # since when, by time.monotonic
        self._declared: list[Any] = []
        self.reopen(port)

    def places(self) -> list[str]:
        """The same name."""
        return [self.port]

    def reopen(self, place: str) -> None:
        """See Link.reopen."""
        self.close()
        its = self._its
        session = network.open_session(self.port, connect=its.connect, config=its.config)
        try:
            epochs = network.alive(session, its.name)
            if not epochs:
                raise PortError(
                    f"nobody shares a board as {its.name}; see `biotac list --zenoh`, start `biotac serve PORT --name "
                    f"{its.name}`, or name its computer: {FORM}"
                )
            if len(epochs) > 1:
                raise PortError(f"{len(epochs)} boards are shared as {its.name}; give them different names")
            self._listen(session, next(iter(epochs)))
            if its.write:
                self._claim(session)
        except BaseException:
            session.close()
            raise
        self._session = session

    def _listen(self, session: Any, epoch: str) -> None:
        with self._came:
            self._batches.clear()
            self._waiting, self._next, self._started, self._gone_s = 0, None, False, math.inf

        def came_or_went(sample: Any) -> None:
            if str(sample.key_expr).endswith(f"/{epoch}"):
                with self._came:
                    self._gone_s = time.monotonic() if "DELETE" in str(sample.kind) else math.inf
                    self._came.notify_all()

        tokens = session.liveliness()
        # Zenoh ends what nobody holds.
        self._declared = [
            session.declare_subscriber(network.key(self._its.name, f"wire/{epoch}"), self._take),
            tokens.declare_subscriber(network.key(self._its.name, "live/*"), came_or_went, history=True),
        ]

    def _claim(self, session: Any) -> None:
        who = f"{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(4)}".replace("/", "_")
        self._secret = secrets.token_bytes(32)
        token = session.liveliness().declare_token(network.key(self._its.name, f"writer/{who}"))
        self._declared.append(token)
        replies = session.get(
            network.key(self._its.name, "claim"), payload=who.encode() + b"\0" + self._secret, timeout=ANSWER_S
        )
        answer = next((reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None), None)
        if answer != b"":
            holder = "nobody who answers" if answer is None else answer.decode(errors="replace")
            raise PortError(
                f"{self.port}: {holder} commands this board, and one may; read it without write=yes, or end that one"
            )

    def _take(self, sample: Any) -> None:
        data = sample.payload.to_bytes()
        if len(data) <= network.NUMBER.size:
            return
        (number,) = network.NUMBER.unpack_from(data)
        with self._came:
            ahead = 0 if self._next is None else number - self._next
            if -REPLAYED <= ahead < 0 or ahead >= FOREIGN:
                return  # it was here, or is nobody's who counts batches
            if self._started:
                self.batches_lost += max(0, ahead)
            self._next = number + 1
            if not self._started:
                return
            self._put(data[network.NUMBER.size :])

    def _put(self, data: bytes) -> None:
        """With ``_came`` held."""
        self._batches.append(data)
        self._waiting += len(data)
        while self._waiting > MAX_WAITING_BYTES:
            self._waiting -= len(self._batches.popleft())
            self.batches_lost += 1
        self._came.notify_all()

    def read(self, timeout_s: float) -> bytes:
        """See Link.read."""
        with self._came:
            if not self._batches:
                self._came.wait_for(lambda: self._batches, timeout_s)
            data = b"".join(self._batches)
            self._batches.clear()
            self._waiting = 0
            if not data and time.monotonic() - self._gone_s >= GONE_S:
                raise DeviceLostError(
                    f"{self.port} is not shared any more; see to `biotac serve` there, and open it again"
                )
            return data

    def write(self, data: bytes) -> None:
        """See Link.write. Waits for the answer, which ``read`` gives."""
        for part in data.split(b"\0"):
            frame = open_frame(part) if part else None
            if frame is not None:
                self._ask(part, *frame)

    def _ask(self, part: bytes, message_id: int, payload: bytes) -> None:
        session = self._session
        if session is None:
            raise DeviceLostError(f"{self.port} was closed; open it again")
        if message_id in rights.OWN:
            with self._came:
                if message_id != wire.Ping.ID:
                    self._started = message_id == wire.Start.ID
                self._put(encode(wire.Reply.ID, wire.Reply(payload[0], message_id, wire.Error.OK).pack()))
            return
        if rights.needs_writer(message_id) and not self._its.write:
            raise CommandRefusedError(
                f"{self.port} is for reading: {rights.command_name(message_id)} changes the board; open it with "
                f"{'&' if '?' in self.port else '?'}write=yes, which one program may at a time",
                wire.Error.NOT_HERE,
            )
        replies = session.get(
            network.key(self._its.name, "command"), payload=part, attachment=self._secret, timeout=ANSWER_S
        )
        for reply in replies:
            if reply.ok is not None:
                with self._came:
                    self._put(reply.ok.payload.to_bytes())

    def release(self) -> None:
        """A shared board's time always runs."""

    def abandon(self) -> None:
        """See Link.abandon: a child has none of the threads, and so nothing that it could disturb."""
        self._session = None
        self._declared = []

    def close(self) -> None:
        """See Link.close."""
        session, self._session = self._session, None
        declared, self._declared = self._declared, []
        if session is not None:
            for its in declared:
                with suppress(Exception):  # a network that is gone is no obstacle to leaving it
                    its.undeclare()
            session.close()
