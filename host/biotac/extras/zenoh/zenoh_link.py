"""``zenoh:NAME``: a board shared by another computer."""

from __future__ import annotations

import math
import os
import secrets
import socket
import threading
import time
from collections import deque
from contextlib import suppress
from typing import Any

from ...errors import CommandRefusedError, DeviceLostError, PortError
from ...link.base import Link
from ...link.port_text import options_of
from ...wire import messages_gen as wire
from ...wire.framing import encode, open_frame
from ...wire.identity import command_name
from . import network, rights

FORM = "zenoh:NAME?connect=tcp/HOST:7447&write=yes&config=FILE"
REPLAYED, FOREIGN = 1 << 12, 1 << 32  # batches back, or ahead, of the one that is due
ANSWER_S = 1.0
# After a cut connection, or a stop shorter than Zenoh's lease, a reader finds the same board again by itself.
ABSENT_S = 0.5


class ZenohLink(Link):
    """A Link to a shared board: a reader, or with ``write=yes`` in the port the only writer.

    For readers, commands that would change the board raise CommandRefusedError. ``batches_lost`` counts the whole
    batches lost because this side was too slow; their frames also count as lost frames. Raises PortError or InputError.
    """

    owns_stream = False
    patience = 2.0  # answers come through a second program
    max_waiting_bytes = 4 << 20  # of unread batches; about half a minute of five fingers

    def __init__(self, port: str, pace: float = 1.0) -> None:
        self._name, options = options_of(port, ("connect", "config", "write"), FORM)
        if not network.NAME.fullmatch(self._name) or options.get("write", "yes") not in ("yes", "no"):
            raise PortError(f"{port}: expected {FORM}; `biotac list --zenoh` lists names")
        self._zenoh = {"connect": options.get("connect"), "config": options.get("config")}
        self._write = options.get("write") == "yes"
        self.port = port
        self.batches_lost = 0
        self._session: Any = None
        self._secret, self._count = b"", 0  # a writer's, and how many commands it signed
        self._came = threading.Condition()
        self._batches: deque[bytes] = deque()
        self._waiting = 0  # bytes
        self._next: int | None = None
        self._started = False
        self._absent_since_s = math.inf  # since when, by time.monotonic
        self._declared: list[Any] = []
        self.reopen(port)
        network.close_at_exit(self)

    def ports(self) -> list[str]:
        return [self.port]

    def reopen(self, port: str) -> None:
        self.close()
        session = network.open_session(self.port, **self._zenoh)
        try:
            boards = network.shared(session, self._name)
            if not boards:
                raise PortError(
                    f"no board is shared as {self._name}; see `biotac list --zenoh`, start `biotac share PORT "
                    f"--zenoh {self._name}`, or give the address of its computer: "
                    f"zenoh:{self._name}?connect=tcp/HOST:7447"
                )
            if len(boards) > 1:
                raise PortError(f"{len(boards)} boards are shared as {self._name}; give them different names")
            self._listen(session, boards[0]["epoch"])
            if self._write:
                self._claim(session)
        except BaseException:
            session.close()
            raise
        self._session = session

    def _listen(self, session: Any, epoch: str) -> None:
        with self._came:
            self._batches.clear()
            self._waiting, self._next, self._started, self._absent_since_s = 0, None, False, math.inf

        def liveliness_changed(sample: Any) -> None:
            if str(sample.key_expr).endswith(f"/{epoch}"):
                with self._came:
                    self._absent_since_s = time.monotonic() if "DELETE" in str(sample.kind) else math.inf
                    self._came.notify_all()

        tokens = session.liveliness()
        # Zenoh undeclares objects that nothing refers to.
        self._declared = [
            session.declare_subscriber(network.key(self._name, f"wire/{epoch}"), self._receive),
            tokens.declare_subscriber(network.key(self._name, "live/*"), liveliness_changed, history=True),
        ]

    def _claim(self, session: Any) -> None:
        client = f"{socket.gethostname()}-{os.getpid()}-{secrets.token_hex(4)}".replace("/", "_")
        token = session.liveliness().declare_token(network.key(self._name, f"writer/{client}"))
        self._declared.append(token)
        replies = session.get(network.key(self._name, "claim"), payload=client.encode(), timeout=ANSWER_S)
        answer = next((reply.ok.payload.to_bytes() for reply in replies if reply.ok is not None), b"")
        if not answer.startswith(network.GRANTED):
            holder = answer.decode(errors="replace") or "unknown, as nobody answers"
            raise PortError(
                f"{self.port}: only one program may write at a time (now {holder}); open without write=yes, or "
                "stop that one"
            )
        self._secret, self._count = answer.removeprefix(network.GRANTED), 0

    def _receive(self, sample: Any) -> None:
        data = sample.payload.to_bytes()
        if len(data) <= network.NUMBER.size:
            return
        (number,) = network.NUMBER.unpack_from(data)
        with self._came:
            ahead = 0 if self._next is None else number - self._next
            if -REPLAYED <= ahead < 0 or ahead >= FOREIGN:
                return  # a repeated batch, or not from a board of ours
            if self._started:
                self.batches_lost += max(0, ahead)
            self._next = number + 1
            if not self._started:
                return
            self._put(data[network.NUMBER.size :])

    def _put(self, data: bytes) -> None:
        """Queue ``data``; call with ``_came`` held."""
        self._batches.append(data)
        self._waiting += len(data)
        while self._waiting > self.max_waiting_bytes:
            self._waiting -= len(self._batches.popleft())
            self.batches_lost += 1
        self._came.notify_all()

    def read(self, timeout_s: float) -> bytes:
        with self._came:
            if not self._batches:
                self._came.wait_for(lambda: self._batches, timeout_s)
            data = b"".join(self._batches)
            self._batches.clear()
            self._waiting = 0
            if not data and time.monotonic() - self._absent_since_s >= ABSENT_S:
                raise DeviceLostError(f"{self.port} is no longer shared; check `biotac share` there and open it again")
            return data

    def write(self, data: bytes) -> None:
        """Send commands and wait for the answers, which ``read`` returns."""
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
        if rights.needs_writer(message_id) and not self._write:
            raise CommandRefusedError(
                f"{self.port} is read-only, and {command_name(message_id)} changes the board; open it with "
                f"{'&' if '?' in self.port else '?'}write=yes (one program at a time)",
                wire.Error.NOT_HERE,
            )
        self._count += 1
        signature = network.signature(self._secret, self._count, part)
        replies = session.get(network.key(self._name, "command"), payload=part, attachment=signature, timeout=ANSWER_S)
        for reply in replies:
            if reply.ok is not None:
                with self._came:
                    self._put(reply.ok.payload.to_bytes())

    def close(self) -> None:
        session, self._session = self._session, None
        declared, self._declared = self._declared, []
        if session is not None:
            for entity in declared:
                with suppress(Exception):  # the network may be gone already
                    entity.undeclare()
            session.close()
