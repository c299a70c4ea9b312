"""One board on a link: the thread that reads it, and commands that are repeated until they are answered."""

from __future__ import annotations

import struct
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from itertools import cycle
from typing import Any, TypeVar

from ..clock.host_clock import HostClock
from ..errors import CommandRefusedError, DeviceLostError, InputError
from ..link import Link
from ..wire import messages_gen as wire
from ..wire.framing import encode
from .connection import Connection, State
from .handshake import describe_mismatch, handshake
from .lasting import Subject
from .reader import Reader

REPLY_TIMEOUT_S = 1.0
REPLY_TRIES = 3
#: The errors for requests that only a newer board knows.
NOT_KNOWN = (wire.Error.UNKNOWN_COMMAND, wire.Error.UNKNOWN_SETTING, wire.Error.BAD_LENGTH)

Reply = TypeVar("Reply")


class Board:
    """The board that answers on ``link``, which is closed when the handshake fails. Any thread may ask it."""

    def __init__(self, link: Link, *, reconnects: bool = False, host_clock: HostClock | None = None,
                 messages: Mapping[int, type[Any]] = wire.MESSAGES) -> None:  # fmt: skip
        self.link = link
        self.host_clock = host_clock or HostClock()
        self._req_ids = cycle(range(1, 256))
        self.ending = threading.RLock()  #: one thread closes it, and others wait until it has
        self._writing = threading.Lock()
        self._asking = threading.RLock()  # one command at a time
        self.connection = Connection(link, reconnects=reconnects)
        try:
            hello = self.handshake()
        except BaseException:
            link.close()
            raise
        self.reader = Reader(self.connection, hello, messages)
        self.reader.start()

    @property
    def info(self) -> wire.Hello:
        """The board's HELLO, from when it was opened or last came back."""
        return self.reader.hello

    @property
    def connected(self) -> bool:
        """Whether the board can be reached: it is neither looked for, nor lost, nor closed."""
        return self.connection.state in (State.OPEN, State.STREAMING)

    def handshake(self) -> wire.Hello:
        """The board's HELLO, read here: nothing else may read the link meanwhile."""
        return handshake(self.link, self._write_numbered, timeout_s=self.patience_s())

    def reopen(self, port: str) -> None:
        """Open another port instead of the lost one, while nobody writes."""
        with self._writing:
            self.link.reopen(port)

    def patience_s(self) -> float:
        """How long one reply may take, s."""
        return REPLY_TIMEOUT_S * self.link.patience

    def close(self) -> None:
        """End reading and give the port back."""
        self.reader.close()
        with self._writing:
            self.connection.give_back()

    # ---- commands ------------------------------------------------------------------------------

    def send(self, request: Any) -> None:
        """Send a command without waiting for a reply. The ``req_id`` is replaced by the next one."""
        self.connection.check()
        self._write_numbered(request)

    def _write_numbered(self, request: Any) -> None:
        self._write(replace(request, req_id=next(self._req_ids)))

    def _write(self, message: Any) -> None:
        try:
            payload = message.pack()
        except struct.error as error:
            name = type(message).__name__
            raise InputError(f"{name} cannot hold these values ({error}); see its ranges in MESSAGES.md") from error
        with self._writing:
            if self.connection.given_back:
                self.connection.raise_closed()
            self.link.write(encode(message.ID, payload))

    @contextmanager
    def turn(self) -> Iterator[None]:
        """No other thread's command gets in between."""
        self.connection.check()
        with self._asking:
            yield

    def ask(self, request: Any, reply: type[Reply], *, timeout_s: float | None = None, quiet: bool = False) -> Reply:
        """Send a command, up to REPLY_TRIES times until it is answered, and return the reply.

        The ``req_id`` is replaced by the next one. ``timeout_s`` is for each try. No batch has the answer to a
        ``quiet`` question. Raises CommandRefusedError when the board refuses; DeviceLostError when it does not answer,
        or is away.
        """
        timeout_s = self.patience_s() if timeout_s is None else timeout_s
        request = replace(request, req_id=next(self._req_ids))
        with self.turn(), self.reader.replies.awaiting(request.req_id, quiet=quiet):
            self.reader.notify_space()
            # The time of the first try counts: whichever try was answered was sent then or later.
            sent_s = time.monotonic()
            for _ in range(REPLY_TRIES):
                self._check_here()  # while this board is looked for, another may be on the port
                self._write(request)
                answer, arrived_s = self._answer(request, reply, timeout_s)
                if isinstance(answer, reply) and not (isinstance(answer, wire.Reply) and answer.error):
                    if isinstance(answer, wire.Status):
                        self._timed(answer, sent_s, arrived_s)
                    return answer
                if answer is not None:
                    raise CommandRefusedError(describe_refusal(request, answer, self.info), answer.error)
        raise DeviceLostError(
            f"{self.link.port} did not answer {type(request).__name__} within {timeout_s * REPLY_TRIES:.0f} s; check "
            "the cable and open it again"
        )

    def _answer(self, request: Any, reply: type[Any], timeout_s: float) -> tuple[Any, float]:
        """The reply and when it arrived; (None, 0) when there is none in time."""
        found: list[tuple[Any, float]] = []
        reader = self.reader

        def reply_arrived() -> bool:
            if not found and (answer := reader.replies.find(request, reply)) is not None:
                found.append(answer)
            return bool(found) or self.connection.state in (State.LOST, State.CLOSED)

        self.connection.wait_for(reply_arrived, timeout_s)
        if found:
            return found[0]
        self._check_here()
        return None, 0.0

    def _check_here(self) -> None:
        if self.connection.closed:
            self.connection.raise_closed()
        if self.connection.lost is not None:
            raise DeviceLostError(f"{self.link.port} is away and being looked for; wait until it returns")

    def _timed(self, answer: wire.Status, sent_s: float, arrived_s: float) -> None:
        self.reader.met(answer.fingers_present)
        if self.link.keeps_time:
            self.reader.clock.round_trip(sent_s, self.reader.unwrap_t_us(answer.t_us), max(sent_s, arrived_s))

    def command(self, request: Any, *, lasting: Subject | None = None) -> None:
        """Send a command that is only confirmed; with ``lasting`` it is sent again after a restart."""
        answers = wire.ANSWERS[type(request)]
        with self.turn():  # a board that restarts before the command is remembered would not be sent it again
            self.ask(request, answers)
            if lasting is not None:
                self.connection.lasting.remember(lasting, lambda: self.ask(request, answers))

    def hold(self, mask: int) -> None:
        """Send HOLD. A RELEASE that was not answered is not repeated for these fingers."""
        with self.turn():
            self.command(wire.Hold(0, mask))
            self.connection.lasting.begin(mask, self.reader.present)

    def release(self, mask: int = 0) -> None:
        """Send RELEASE for these fingers and those of the RELEASEs that were not answered, if there are any."""
        lasting = self.connection.lasting
        lasting.end(mask)
        with self.turn():
            if mask := lasting.unreleased:
                try:
                    self.command(wire.Release(0, mask))
                except CommandRefusedError:  # that is an answer, too
                    lasting.released(mask)
                    raise
                lasting.released(mask)

    def release_unanswered(self, mask: int) -> None:
        """Send RELEASE without waiting for the answer, for another command, or for a board that is away."""
        self.connection.lasting.end(mask)
        if self.connected:
            with suppress(DeviceLostError):
                self._write_numbered(wire.Release(0, mask))

    def restore(self) -> None:
        """Repeat everything that lasts until the board restarts: settings, calibrations and maps.

        Not tares, which recovery.py restores with their age. Raises CommandRefusedError if the board refuses one: the
        forces would no longer be those that were asked for.
        """
        for (kind, number), again in self.connection.lasting.commands():
            try:
                again()
            except CommandRefusedError as error:
                text = (
                    f"{self.link.port} came back, but not with its {kind} {number}: {error}; open it and set it again"
                )
                raise CommandRefusedError(text, error.error) from error


def describe_refusal(request: Any, reply: wire.Reply, board: wire.Hello) -> str:
    """One line with the command and the board's reason; if the versions may be the cause, also those and the cure."""
    name = wire.Error(reply.error).name if reply.error in list(wire.Error) else f"error {reply.error}"
    text = f"the board refused {type(request).__name__}: {name} ({wire.ERROR_DOC.get(reply.error, 'unknown')})"
    if reply.error in NOT_KNOWN and (board.wire_major, board.wire_minor) != (wire.WIRE_MAJOR, wire.WIRE_MINOR):
        text += f"; its firmware speaks {describe_mismatch(board)}"
    return text
