"""The conversation with one board: handshake, commands and their replies.

Bytes are read by whoever waits for something, or, once there is one, by a Reader's threads (live/reader.py).
"""

from __future__ import annotations

import secrets
import struct
import threading
import time
from abc import abstractmethod
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any, TypeVar

from ..clock import LAST_SAMPLE_US, Arrivals, DeviceClock
from ..clock.wall import Timing
from ..errors import CommandRefusedError, DeviceLostError, InputError, NotAGatewayError, WireVersionError
from ..link import Link
from ..link.serial_port import went_away
from ..wire import messages_gen as wire
from ..wire.batches import Batch, LinkStats, StreamDecoder
from ..wire.framing import encode
from . import compatibility
from .commands import Commands, Reply
from .compatibility import HandWarning, describe_mismatch
from .gap import Gap, Reason
from .session import Session

if TYPE_CHECKING:
    from ..recording.writer import Recorder
    from .reader import Reader

REPLY_TIMEOUT_S = 1.0
REPLY_TRIES = 3

Got = TypeVar("Got")


class Conversation(Commands):
    """What a Hand needs of its link. Closes the link when the handshake fails."""

    def __init__(self, link: Link, *, reconnect: bool, timing: Timing) -> None:
        self.link = link
        self.timing = timing
        #: The board can be talked to; false while it is looked for.
        self.connected = True
        self.closing = threading.Event()
        self._reconnect = reconnect
        self._decoder = StreamDecoder()
        self._past: list[LinkStats] = []  # of decoders before a reboot
        self._replies: deque[Any] = deque()
        self._reader: Reader | None = None
        self._recorder: Recorder | None = None
        self._session = Session()
        self._started: wire.Start | None = None
        self._streaming = False
        self._req_id = 0
        self._bytes = 0
        self._frames = 0
        self._gaps = 0
        self._gap: Gap | None = None  # to go with the next rows
        self._failure: BaseException | None = None
        self._trouble: OSError | InputError | None = None
        self._reading = threading.RLock()  # whose holder reads the link
        self._writing = threading.Lock()
        self._asking = threading.RLock()  # one command at a time
        self._awaiting = 0
        self._changed = threading.Condition()
        self._waiters = 0  # for _changed
        self._closed = False
        #: Device time as host time, fed by whatever is read; known after a first ``status`` or ``sync``.
        #: A simulated board's time is no clock: it waits for the computer, which shows as ``resets``.
        self.clock = DeviceClock(unix_offset_s=time.time() - time.monotonic())
        self._arrivals = Arrivals(self.clock)
        try:
            self.info = self._handshake()
        except BaseException:
            link.close()
            raise

    @property
    def port(self) -> str:
        """The PORT this was opened as."""
        return self.link.port

    @property
    def warnings(self) -> list[HandWarning]:
        """What speaks against this board and this library together, in words; empty when nothing does."""
        return compatibility.warnings(self.info, self.port)

    @property
    def stats(self) -> LinkStats:
        """Counts since the handshake, over reboots too."""
        now = self._decoder.stats(self._bytes, self._frames)
        lost = {
            name: sum(getattr(stats, name) for stats in (*self._past, now))
            for name in ("frames_lost", "pac_lost", "disordered", "crc_errors", "other_errors")
        }
        return replace(now, gaps=self._gaps, **lost)

    def _patience_s(self) -> float:
        """How long a reply may take."""
        return REPLY_TIMEOUT_S * self.link.patience

    # ---- handshake -----------------------------------------------------------------------------

    def _handshake(self) -> wire.Hello:
        # A board may still be streaming to whoever was here before: stop it, then look for the one
        # HELLO that carries our nonce and let everything else pass.
        nonce = secrets.randbits(32)
        decoder = StreamDecoder()
        # The known fields of HELLO never change place, so that any peer can be told its version.
        decoder.accept_newer_minor()
        seen = 0

        def hello(left_s: float) -> wire.Hello | None:
            nonlocal seen
            chunk = self.link.read(max(0.0, left_s))
            seen += len(chunk)
            messages = decoder.feed(chunk).messages
            return next((m for m in messages if isinstance(m, wire.Hello) and m.nonce == nonce), None)

        for _ in range(REPLY_TRIES):
            deadline = time.monotonic() + self._patience_s()
            self.link.write(b"\0")  # ends whatever half frame a former program left behind
            self._send(wire.Stop(self._next_req_id()))
            self._send(wire.HelloRequest(self._next_req_id(), nonce))
            left_s = self._patience_s()
            while left_s > 0:
                # What has come is looked at before the time is said to be over: it may be this side that was late.
                left_s = deadline - time.monotonic()
                told = hello(left_s)
                if told is not None:
                    return self._checked(told)
        raise NotAGatewayError(self._describe_stranger(decoder.counts.good, seen))

    def _checked(self, hello: wire.Hello) -> wire.Hello:
        if hello.wire_major != wire.WIRE_MAJOR:
            raise WireVersionError(f"the firmware on {self.port} speaks {describe_mismatch(hello)}")
        if hello.wire_minor > wire.WIRE_MINOR:
            self._decoder.accept_newer_minor()
        return hello

    def _describe_stranger(self, good: int, count: int) -> str:
        if count == 0:
            seen = "nothing answers"
        elif good:
            seen = f"{good} frames of this protocol came, but no HELLO"
        else:
            seen = f"{count} bytes came that are no frames of this protocol"
        return (
            f"no gateway on {self.port}: {seen}; expected a HELLO within {self._patience_s() * REPLY_TRIES:.0f} s; "
            "check that this is the board's port and that it runs our firmware"
        )

    # ---- reading -------------------------------------------------------------------------------

    @abstractmethod
    def _arrived(self, batch: Batch) -> None:
        """Something has come; called by whoever reads."""

    @abstractmethod
    def _last_t_us(self) -> int | None:
        """Device time of the latest row; None before any."""

    def _pump(self, timeout_s: float) -> bool:
        """Read once; False when nothing came within timeout_s. Not while a Reader does."""
        with self._reading:
            fd = self.link.fd
            try:
                if fd is None:
                    chunk = self.link.read(timeout_s)
                else:
                    batch = self._decoder.read(fd, timeout_s)
            except DeviceLostError as error:
                self._lost(error, "unplugged")
                return True
            except OSError as error:
                self._lost(went_away(self.port, error), "unplugged")
                return True
            if fd is None:
                self._take(chunk)
                return bool(chunk)
            if self._recorder is not None:
                self._record(self._recorder, b"" if batch is None else self._decoder.chunk())
            if batch is None:
                return False
            self._hand_out(batch, self._decoder.arrived_s)
            return True

    def _take(self, chunk: bytes) -> None:
        if self._recorder is not None:
            self._record(self._recorder, chunk)
        if chunk:
            arrived_s = time.monotonic()
            self._hand_out(self._decoder.feed(chunk), arrived_s)

    def _hand_out(self, batch: Batch, arrived_s: float) -> None:
        decoder = self._decoder
        self._bytes += decoder.taken
        last_us = decoder.last_t_us
        if last_us is not None:
            self._arrivals.note(last_us + LAST_SAMPLE_US, arrived_s)
            self._frames += len(batch.wire)
        elif not (len(batch.pac) or batch.messages):
            return
        if self._gap is not None:
            first_us = batch.first_t_us()
            if first_us is not None:
                self._mark(replace(self._gap, next_t_us=first_us), batch)
        if self._awaiting:
            self._replies.extend(batch.messages)
        self._arrived(batch)
        # Without a lock where nobody waits: whoever comes to wait after this looks first.
        if self._waiters:
            with self._changed:
                self._changed.notify_all()

    def _wait_for(self, so: Callable[[], Any], timeout_s: float | None = None) -> bool:
        """Until ``so``, as a reading thread makes it; false after timeout_s without it."""
        with self._changed:
            self._waiters += 1
            try:
                return bool(self._changed.wait_for(so, timeout_s))
            finally:
                self._waiters -= 1

    def _record(self, recorder: Recorder, chunk: bytes) -> None:
        try:
            recorder.write(chunk)
        except OSError as error:
            if self._reader is None:
                raise
            # A full disk ends the recording, not the reading; the next call says so.
            self._recorder = None
            self._trouble = error

    def _until(self, done: Callable[[], Got | None], deadline_s: float) -> Got | None:
        """Read, or wait for whoever reads, until ``done`` gives something; None after deadline_s without it."""
        if self._reader is None or self._reader.is_here():
            left_s = 1.0
            while (got := done()) is None and left_s > 0:
                left_s = deadline_s - time.monotonic()
                self._pump(max(0.0, left_s))  # once more when time is over: it may be this side that was late
            return got
        found: list[Got] = []

        def so() -> bool:
            got = done()
            if got is not None:
                found.append(got)
            return bool(found) or self._failure is not None or not self.connected or self.closing.is_set()

        self._wait_for(so, max(0.0, deadline_s - time.monotonic()))
        if not found and self._failure is not None:
            raise self._failure
        return found[0] if found else None

    # ---- commands ------------------------------------------------------------------------------

    def _next_req_id(self) -> int:
        self._req_id = self._req_id % 255 + 1
        return self._req_id

    def _send(self, message: Any) -> None:
        if self._closed:
            raise DeviceLostError(f"this Hand on {self.port} was closed; open the port again")
        try:
            payload = message.pack()
        except struct.error as error:
            name = type(message).__name__
            raise InputError(f"{name} cannot hold these values ({error}); see its ranges in MESSAGES.md") from error
        if message.ID in compatibility.APPENDED:
            payload = compatibility.cut(message.ID, payload, self.info.wire_minor)
        with self._writing:
            self.link.write(encode(message.ID, payload))

    def status(self) -> wire.Status:
        """Counters of the board and its link. Its time of answering also feeds ``clock``."""
        # Of several tries the first one's time holds: whichever was answered had left by then, or later.
        sent_s = time.monotonic()
        status = super().status()
        self.clock.round_trip(sent_s, self._decoder.unwrap_t_us(status.t_us), time.monotonic())
        return status

    def sync(self, round_trips: int = 5) -> None:
        """Ask for the board's time: ``clock`` gets its bound from round trips, and the drift from later ones."""
        for _ in range(round_trips):
            self.status()

    def _await(self, wanted: Callable[[Any], bool], deadline_s: float) -> Any:
        """A message that passes ``wanted``; None after deadline_s without it."""

        def found() -> Any:
            while self._replies:
                message = self._replies.popleft()
                if wanted(message):
                    return message
            return None

        self._awaiting += 1
        try:
            return self._until(found, deadline_s)
        finally:
            self._awaiting -= 1

    def _ask(self, request: Any, kind: type[Reply]) -> Reply:
        """Send a command, retry it, return its reply; CommandRefusedError when the board says no."""

        def answers(m: Any) -> bool:
            return isinstance(m, (kind, wire.Reply)) and bool(getattr(m, "req_id", 0) == request.req_id)

        with self._asking:
            self._replies.clear()
            self._awaiting += 1
            try:
                for _ in range(REPLY_TRIES):
                    if not self.connected and not self._is_bringing_back():
                        raise DeviceLostError(f"{self.port} is away and looked for; wait for its return")
                    deadline_s = time.monotonic() + self._patience_s()
                    self._send(request)
                    answer = self._await(answers, deadline_s)
                    if isinstance(answer, kind) and not (isinstance(answer, wire.Reply) and answer.error):
                        self._session.note(request)
                        return answer
                    if answer is not None:
                        raise CommandRefusedError(describe_refusal(request, answer), answer.error)
            finally:
                self._awaiting -= 1
        raise DeviceLostError(
            f"{self.port} did not answer {type(request).__name__} within "
            f"{self._patience_s() * REPLY_TRIES:.0f} s; check the cable and open it again"
        )

    def _is_bringing_back(self) -> bool:
        return self._reader is None or self._reader.is_here()

    @abstractmethod
    def _lost(self, error: DeviceLostError, reason: Reason) -> None:
        """The link is gone: raise, or return once the board is back as it was."""

    @abstractmethod
    def _mark(self, gap: Gap, batch: Batch) -> None:
        """``batch`` has the first rows after the gap."""


def describe_refusal(request: Any, reply: wire.Reply) -> str:
    """One line naming the command and the board's reason."""
    name = wire.Error(reply.error).name if reply.error in list(wire.Error) else f"error {reply.error}"
    return f"the board refused {type(request).__name__}: {name} ({wire.ERROR_DOC.get(reply.error, 'unknown')})"
