"""One board with its fingers: handshake, streams, frames. Its commands are in commands.py."""

from __future__ import annotations

import os
import secrets
import struct
import time
from collections import deque
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from . import _wire as wire
from ._sensor import MAX_SENSORS
from .commands import ALL_FINGERS, Commands, Reply
from .errors import CommandRefusedError, DeviceLostError, InputError, NotAGatewayError, WireVersionError
from .frames import Frame, StructArray
from .framing import encode
from .link import Link
from .stream import Batch, LinkStats, StreamDecoder, join, split

if TYPE_CHECKING:
    from .recording.writer import Recorder

#: What a FRAME can say of a contact, for Hand.subscribe.
RESULTS = wire.QuantityFlags.POC | wire.QuantityFlags.FORCE | wire.QuantityFlags.TORQUE
REPLY_TIMEOUT_S = 1.0
REPLY_TRIES = 3
# A streaming board sends a status every second by default; three missing ones are a dead link.
SILENCE_S = 3.0


class Hand(Commands):
    """A board. Use as a context manager; made by ``biotac.open``.

    This class reads only when asked: a slow caller makes the operating system's buffer fill and then
    the board drop whole frames, which ``stats.frames_lost`` counts.
    """

    def __init__(self, link: Link) -> None:
        self.link = link
        self._decoder = StreamDecoder()
        self._batches: deque[Batch] = deque()
        self._replies: deque[Any] = deque()
        self._recorder: Recorder | None = None
        self._req_id = 0
        self._bytes = 0
        self._frames = 0
        self._streaming = False
        self._ended = False
        self._closed = False
        try:
            self.info = self._handshake()
        except BaseException:
            link.close()
            raise

    # ---- life ----------------------------------------------------------------------------------

    @property
    def port(self) -> str:
        """The PORT this was opened as."""
        return self.link.port

    @property
    def fingers(self) -> list[int]:
        """Indices of the fingers whose sensor answered when this was opened."""
        return [f for f in range(MAX_SENSORS) if self.info.fingers_present >> f & 1]

    def __repr__(self) -> str:
        return f"<biotac.Hand on {self.port}, fingers {self.fingers}{', closed' if self._closed else ''}>"

    def __enter__(self) -> Hand:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Stop the stream, finish a recording, give the port back. Safe to call twice."""
        if self._closed:
            return
        try:
            if self._streaming:
                self._streaming = False
                self._send(wire.Stop(self._next_req_id()))
        except DeviceLostError:
            pass  # it is gone already, which is what closing wants
        finally:
            self._closed = True
            try:
                if self._recorder is not None:
                    self._recorder.close()
            finally:
                self.link.close()

    def _handshake(self) -> wire.Hello:
        # A board may still be streaming to whoever was here before: stop it, then look for the one
        # HELLO that carries our nonce and let everything else pass.
        nonce = secrets.randbits(32)
        self._decoder = StreamDecoder()
        # The known fields of HELLO never change place, so that any peer can be told its version.
        self._decoder.accept_newer_minor()
        for _ in range(REPLY_TRIES):
            self.link.write(b"\0")  # ends whatever half frame a former program left behind
            self._send(wire.Stop(self._next_req_id()))
            self._send(wire.HelloRequest(self._next_req_id(), nonce))
            hello: wire.Hello | None = self._await(lambda m: isinstance(m, wire.Hello) and m.nonce == nonce)
            if hello is not None:
                break
        else:
            raise NotAGatewayError(self._describe_stranger())
        if hello.wire_major != wire.WIRE_MAJOR:
            raise WireVersionError(
                f"the firmware on {self.port} speaks wire {hello.wire_major}.{hello.wire_minor}, this library "
                f"{wire.WIRE_MAJOR}.{wire.WIRE_MINOR}; install the firmware and the biotac-gateway of one release"
            )
        # What streamed before this handshake is nobody's: counting starts here.
        self._decoder = StreamDecoder()
        self._batches.clear()
        self._replies.clear()
        self._bytes = 0
        self._frames = 0
        if hello.wire_minor > wire.WIRE_MINOR:
            self._decoder.accept_newer_minor()
        return hello

    def _describe_stranger(self) -> str:
        counts = self._decoder.counts
        if self._bytes == 0:
            seen = "nothing answers"
        elif counts.good:
            seen = f"{counts.good} frames of this protocol came, but no HELLO"
        else:
            seen = f"{self._bytes} bytes came that are no frames of this protocol"
        return (
            f"no gateway on {self.port}: {seen}; expected a HELLO within "
            f"{REPLY_TIMEOUT_S * REPLY_TRIES:.0f} s; check that this is the board's port and that it runs our firmware"
        )

    # ---- streams (further commands: commands.py) -----------------------------------------------

    def start(self, *, pac: bool = True, fingers: int = ALL_FINGERS) -> None:
        """Start streaming frames, status and, unless told otherwise, PAC; ``fingers`` is a bit mask."""
        streams = wire.StreamFlags.FRAMES | wire.StreamFlags.STATUS
        if pac:
            streams |= wire.StreamFlags.PAC
        # Keep-alive stays off: this class reads, and so could ping, only when its caller asks.
        self._command(wire.Start(self._next_req_id(), int(streams), fingers, 0))
        self._streaming = True
        self.link.release()

    def stop(self) -> None:
        """Stop streaming. Frames already on their way are still delivered."""
        self._command(wire.Stop(self._next_req_id()))
        self._streaming = False

    # ---- frames --------------------------------------------------------------------------------

    @property
    def stats(self) -> LinkStats:
        """Counts since the handshake."""
        return self._decoder.stats(self._bytes, self._frames)

    @property
    def ended(self) -> bool:
        """A simulated source has played to its end and everything of it has arrived."""
        return self._ended

    def batches(self) -> Iterator[Batch]:
        """Yield batches as they arrive, starting the stream if need be.

        Ends with a simulated source, and when ``stop`` is called.
        """
        if not self._streaming and not self._ended:
            self.start()
        while True:
            while self._batches:
                yield self._batches.popleft()
            if self._ended or not self._streaming:
                return
            self._pump_stream()

    def frames(self) -> Iterator[Frame]:
        """Yield typed frames as they arrive; ends only with a simulated source."""
        for batch in self.batches():
            for k in range(len(batch.frames)):
                yield Frame.from_row(batch.frames[k])

    def read(self, seconds: float) -> StructArray:
        """Return the frames of the next ``seconds`` of device time as one FRAME_DTYPE array (n,).

        Shorter when a simulated source ends first; empty when it has ended before, or when no sensor
        answered in that time. Raises ValueError unless seconds is a number above 0.
        """
        return self.read_batch(seconds).frames

    def read_batch(self, seconds: float) -> Batch:
        """Like read, with the wire messages, PAC and events of the same time."""
        if not 0 < seconds < float("inf"):
            raise ValueError(f"seconds is {seconds}, expected a number above 0")
        taken: list[Batch] = []
        end_us: int | None = None
        first_status_us: int | None = None
        for batch in self.batches():
            for status in (m for m in batch.messages if isinstance(m, wire.Status)):
                first_status_us = status.t_us if first_status_us is None else first_status_us
                if end_us is None and (status.t_us - first_status_us) % 2**32 > (seconds + SILENCE_S) * 1e6:
                    return join(taken)  # the board is there, its sensors are not
            first_us, last_us = batch.first_t_us(), batch.last_t_us()
            if end_us is None and first_us is not None:
                end_us = first_us + round(seconds * 1e6)
            if end_us is None or last_us is None or last_us < end_us:
                taken.append(batch)
                continue
            now, later = split(batch, end_us)
            taken.append(now)
            self._batches.appendleft(later)
            break
        return join(taken)

    def record(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Recorder:
        """Write everything that arrives from now on to an MCAP file, until close or the recorder's close.

        Frames that have arrived already and wait to be read are not in it; call it before ``start`` or
        the first read to have all.

        Raises InputError when the file exists and may not be overwritten, cannot be written, or when
        another recording of this hand is still open.
        """
        from .recording.writer import Recorder

        if self._recorder is not None and not self._recorder.closed:
            raise InputError(f"this hand is being recorded to {self._recorder.path}; close that recorder first")
        sensors = [self.sensor_info(f) for f in self.fingers]
        self._recorder = Recorder(
            Path(path),
            self.info,
            self.settings(),
            self.calibrations(),
            sensors,
            self.port,
            overwrite=overwrite,
            mid_stream=self._streaming,
        )
        return self._recorder

    # ---- plumbing ------------------------------------------------------------------------------

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
        self.link.write(encode(message.ID, payload))

    def _pump(self, timeout_s: float) -> bool:
        chunk = self.link.read(timeout_s)
        if self._recorder is not None:
            self._recorder.write(chunk)
        if not chunk:
            return False
        self._bytes += len(chunk)
        batch = self._decoder.feed(chunk)
        self._frames += len(batch.wire)
        self._replies.extend(batch.messages)
        if len(batch.wire) or len(batch.pac) or len(batch.idle) or batch.messages:
            self._batches.append(batch)
        return True

    def _pump_stream(self) -> None:
        if self.link.ended:
            self.ping()  # a barrier: its reply comes behind the last frame
            self._ended = True
            self._streaming = False
            return
        self._replies.clear()
        if not self._pump(SILENCE_S) and not self.link.ended:
            raise DeviceLostError(
                f"{self.port} has been silent for {SILENCE_S:.0f} s while streaming; check the cable and open it again"
            )

    def _await(self, wanted: Any) -> Any:
        """Pump until a message passes ``wanted``; None after a second without it."""
        deadline = time.monotonic() + REPLY_TIMEOUT_S
        while True:
            while self._replies:
                message = self._replies.popleft()
                if wanted(message):
                    return message
            left = deadline - time.monotonic()
            if left <= 0:
                return None
            self._pump(left)

    def _ask(self, request: Any, kind: type[Reply]) -> Reply:
        """Send a command, retry it, return its reply; CommandRefusedError when the board says no."""

        def answers(m: Any) -> bool:
            return isinstance(m, (kind, wire.Reply)) and bool(getattr(m, "req_id", 0) == request.req_id)

        for _ in range(REPLY_TRIES):
            self._send(request)
            answer = self._await(answers)
            if isinstance(answer, kind) and not (isinstance(answer, wire.Reply) and answer.error):
                return answer
            if answer is not None:
                raise CommandRefusedError(describe_refusal(request, answer), answer.error)
        raise DeviceLostError(
            f"{self.port} did not answer {type(request).__name__} within "
            f"{REPLY_TIMEOUT_S * REPLY_TRIES:.0f} s; check the cable and open it again"
        )


def describe_refusal(request: Any, reply: wire.Reply) -> str:
    """One line naming the command and the board's reason."""
    name = wire.Error(reply.error).name if reply.error in list(wire.Error) else f"error {reply.error}"
    return f"the board refused {type(request).__name__}: {name} ({wire.ERROR_DOC.get(reply.error, 'unknown')})"
