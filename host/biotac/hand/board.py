"""One board on a link: who reads it, who waits, and commands that are repeated until they are answered."""

from __future__ import annotations

import struct
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from itertools import cycle
from typing import Any, NoReturn, TypeVar

from ..clock.host_clock import HostClock, SystemClock
from ..errors import CommandRefusedError, DeviceLostError, InputError
from ..link import Link
from ..link.serial_port import went_away
from ..wire import messages_gen as wire
from ..wire.batches import Batch
from ..wire.framing import encode
from . import compatibility
from .gap import Reason
from .handshake import handshake
from .incoming import Incoming

REPLY_TIMEOUT_S = 1.0
REPLY_TRIES = 3
#: The errors with which a board refuses what only the other side knows.
NOT_KNOWN = (wire.Error.UNKNOWN_COMMAND, wire.Error.UNKNOWN_SETTING, wire.Error.BAD_LENGTH)
# The longest wait for a link before other conditions are checked, such as closing.
POLL_S = 0.2

Got = TypeVar("Got")
Reply = TypeVar("Reply")


class Board:
    """The board that answers on ``link``, which is closed when the handshake fails.

    By itself it reads only while it waits for a reply. Other parts hook in through the callables below, which are to be
    set before anything is read.
    """

    def __init__(self, link: Link, *, host_clock: HostClock | None = None) -> None:
        self.link = link
        self.host_clock = host_clock or SystemClock()
        #: Called with every batch that is not empty, on the thread that reads.
        self.deliver: Callable[[Batch], object] = lambda batch: None
        #: Called when the link is lost: raises, or returns once the board is back as it was.
        self.lost: Callable[[DeviceLostError, Reason], None] = self._lost
        #: Whether the caller's thread reads the link; other threads wait for what it reads.
        self.is_read_here: Callable[[], bool] = lambda: True
        self.is_pulled = True  #: no reading threads: whoever waits reads
        self.connected = True  #: the board can be reached; false while it is looked for, lost or closed
        self.closing = threading.Event()  #: set when everything is to end
        self.closed = False
        self.failure: BaseException | None = None  #: the error that ended all reading for good
        self._told = False  # the failure was raised to a caller
        self.awaiting = 0  #: how many replies are waited for
        self._replies: deque[Any] = deque()
        self._lasting: dict[tuple[str, int], Callable[[], object]] = {}
        self._req_ids = cycle(range(1, 256))
        self._reading = threading.RLock()  # its holder reads the link
        self._writing = threading.Lock()
        self._asking = threading.RLock()  # one command at a time
        self._changed = threading.Condition()
        self._waiters = 0  # how many threads wait for _changed
        try:
            self.info = self.handshake()
        except BaseException:
            link.close()
            raise
        #: Everything it sends after its HELLO.
        self.incoming = Incoming(link, self.info, self._arrived)

    def handshake(self) -> wire.Hello:
        """The board's HELLO; see handshake.py."""
        return handshake(self.link, self.send, timeout_s=self._patience_s())

    def _patience_s(self) -> float:
        """How long one reply may take, s."""
        return REPLY_TIMEOUT_S * self.link.patience

    def _lost(self, error: DeviceLostError, reason: Reason) -> None:
        self.fail(error)
        self._told = self.is_pulled  # otherwise it is raised in one of our own threads
        raise error

    def fail(self, error: BaseException) -> None:
        """End everything with ``error``: every call from now on raises it. The first of several errors counts."""
        self.failure = self.failure or error
        self.connected = False
        self.notify()

    def check(self) -> None:
        """Raise the failure, if there is one."""
        if self.failure is not None:
            self._told = True
            raise self.failure

    def report(self) -> None:
        """Raise the failure, if there is one that has not been raised to a caller before."""
        if not self._told:
            self.check()

    def is_away(self) -> bool:
        """Whether the board is being looked for. Raises the failure, if there is one."""
        self.check()
        return not (self.connected or self.closed)

    def raise_closed(self) -> NoReturn:
        """Raise the failure, or else DeviceLostError saying that the hand was closed."""
        self.check()
        raise DeviceLostError(f"this Hand on {self.link.port} was closed; open the port again")

    def close(self) -> None:
        """Give the port back as soon as no thread reads or writes it."""
        self.closing.set()
        with self._reading, self._writing:
            self.closed = True
            self.connected = False
            self.link.close()

    def forked(self) -> None:
        """Let go of the board in a forked child: only the process that opened it may use it."""
        # The holders of these locks are threads of the parent process.
        self._reading, self._writing, self._asking = threading.RLock(), threading.Lock(), threading.RLock()
        self._changed, self.closing = threading.Condition(), threading.Event()
        self.closing.set()
        self.closed, self.connected, self.incoming.record = True, False, None
        self.failure = DeviceLostError(
            f"this Hand on {self.link.port} belongs to the process that opened it, not to a fork of it; open boards "
            "in the process that reads them"
        )
        self.link.abandon()

    # ---- reading -------------------------------------------------------------------------------

    def read(self, timeout_s: float) -> bool:
        """Read once; false when nothing came within timeout_s. Raises what ``lost`` raises."""
        with self._reading:
            if self.closed:
                self.raise_closed()
            try:
                came = self.incoming.read(timeout_s)
            except DeviceLostError as error:
                self.lost(error, "unplugged")
                return True
            except OSError as error:
                self.lost(went_away(self.link.port, error), "unplugged")
                return True
            return self.incoming.take(came)

    def _arrived(self, batch: Batch) -> None:
        if self.awaiting:
            self._replies.extend(batch.messages)
        self.deliver(batch)
        # No lock is needed when nobody waits: a thread that waits after this checks its condition first.
        if self._waiters:
            self.notify()

    # ---- waiting -------------------------------------------------------------------------------

    def notify(self) -> None:
        """Wake everyone in ``wait_for``, to check again."""
        with self._changed:
            self._changed.notify_all()

    def wait_for(self, so: Callable[[], Any], timeout_s: float | None = None) -> bool:
        """Wait until ``so`` is true, by what another thread reads; false when it is not within timeout_s."""
        with self._changed:
            self._waiters += 1
            try:
                return bool(self._changed.wait_for(so, timeout_s))
            finally:
                self._waiters -= 1

    def _until(self, done: Callable[[], Got | None], deadline_s: float) -> Got | None:
        """Read, or wait for the thread that reads, until ``done`` returns something; None at deadline_s."""
        if self.is_read_here():
            left_s = 1.0
            while (got := done()) is None and left_s > 0:
                left_s = deadline_s - time.monotonic()
                # Once more when the time is over: this side may have been late.
                self._read_or_wait(max(0.0, min(left_s, POLL_S)))
            return got
        found: list[Got] = []

        def so() -> bool:
            got = done()
            if got is not None:
                found.append(got)
            return bool(found) or not self.connected or self.closing.is_set()

        self.wait_for(so, max(0.0, deadline_s - time.monotonic()))
        if not found:
            self.check()
        return found[0] if found else None

    def _read_or_wait(self, timeout_s: float) -> None:
        """Read; while another thread reads, wait for what it gets."""
        if not self._reading.acquire(blocking=False):
            self.wait_for(lambda: self._replies, timeout_s)
            return
        try:
            self.read(timeout_s)
        finally:
            self._reading.release()

    # ---- commands ------------------------------------------------------------------------------

    def send(self, request: Any) -> None:
        """Send a command without waiting for a reply. Its ``req_id`` is replaced by the next one."""
        self._write(replace(request, req_id=next(self._req_ids)))

    def ask_time(self) -> None:
        """Ask for the board's time without waiting: the answer goes to the clock and nowhere else."""
        req_id = next(self._req_ids)
        self.incoming.time_asked(req_id)
        self._write(wire.GetStatus(req_id))

    def _write(self, message: Any) -> None:
        try:
            payload = message.pack()
        except struct.error as error:
            name = type(message).__name__
            raise InputError(f"{name} cannot hold these values ({error}); see its ranges in MESSAGES.md") from error
        with self._writing:
            if self.closed:
                self.raise_closed()
            self.link.write(encode(message.ID, payload))

    def next_message(self, wanted: Callable[[Any], bool], deadline_s: float) -> Any:
        """The first message to arrive that passes ``wanted``; None if there is none until deadline_s."""

        def found() -> Any:
            while self._replies:
                message = self._replies.popleft()
                if wanted(message):
                    return message
            return None

        self.awaiting += 1
        try:
            return self._until(found, deadline_s)
        finally:
            self.awaiting -= 1

    @contextmanager
    def _turn(self) -> Iterator[None]:
        """One command at a time. A reading thread keeps reading until its turn, as another thread awaits a reply."""
        while not self._asking.acquire(blocking=self.is_pulled or not self.is_read_here()):
            self.read(POLL_S)
        try:
            yield
        finally:
            self._asking.release()

    def ask(self, request: Any, reply: type[Reply]) -> Reply:
        """Send a command, up to REPLY_TRIES times until it is answered, and return its reply.

        Its ``req_id`` is replaced by the next one. Raises CommandRefusedError when the board refuses; DeviceLostError
        when it does not answer, or is away.
        """

        def answers(m: Any) -> bool:
            if isinstance(m, wire.Reply) and (m.req_id, m.command) == (0, request.ID):
                return True  # the command had a length that the board does not know, so it read no req_id
            return isinstance(m, (reply, wire.Reply)) and bool(getattr(m, "req_id", 0) == request.req_id)

        self.check()
        with self._turn():
            request = replace(request, req_id=next(self._req_ids))
            self._replies.clear()
            # The time of the first try counts: whichever try was answered was sent then or later.
            sent_s = time.monotonic()
            self.awaiting += 1
            try:
                for _ in range(REPLY_TRIES):
                    if not self.connected and not self.is_read_here():
                        raise DeviceLostError(f"{self.link.port} is away and being looked for; wait until it returns")
                    deadline_s = time.monotonic() + self._patience_s()
                    self._write(request)
                    answer = self.next_message(answers, deadline_s)
                    if isinstance(answer, reply) and not (isinstance(answer, wire.Reply) and answer.error):
                        if isinstance(answer, wire.Status):
                            self.incoming.round_trip(answer, sent_s, time.monotonic())
                        return answer
                    if answer is not None:
                        raise CommandRefusedError(describe_refusal(request, answer, self.info), answer.error)
            finally:
                self.awaiting -= 1
        raise DeviceLostError(
            f"{self.link.port} did not answer {type(request).__name__} within "
            f"{self._patience_s() * REPLY_TRIES:.0f} s; check the cable and open it again"
        )

    def tell(self, request: Any, *, lasting: tuple[str, int] | None = None) -> None:
        """Send a command whose reply only confirms it; with ``lasting`` it is remembered, see ``remember``."""
        answers = wire.ANSWERS[type(request)]
        self.ask(request, answers)
        if lasting is not None:
            self.remember(lasting, lambda: self.ask(request, answers))

    def remember(self, what: tuple[str, int], again: Callable[[], object]) -> None:
        """Remember to tell a board that restarted ``what`` (kind, number) again, by ``again``; the latest goes last."""
        with self._turn():
            self._lasting.pop(what, None)
            self._lasting[what] = again

    def tell_again(self) -> None:
        """Repeat everything that lasts until the board restarts: settings, calibrations, maps and subscriptions.

        Not tares: after a restart the board takes its own, and an earlier one may be wrong by then.
        """
        for again in list(self._lasting.values()):
            again()


def describe_refusal(request: Any, reply: wire.Reply, board: wire.Hello) -> str:
    """One line with the command and the board's reason; if the versions may be the cause, also those and the cure."""
    name = wire.Error(reply.error).name if reply.error in list(wire.Error) else f"error {reply.error}"
    text = f"the board refused {type(request).__name__}: {name} ({wire.ERROR_DOC.get(reply.error, 'unknown')})"
    if reply.error in NOT_KNOWN and (board.wire_major, board.wire_minor) != (wire.WIRE_MAJOR, wire.WIRE_MINOR):
        text += f"; its firmware speaks {compatibility.describe_mismatch(board)}"
    return text
