"""A recording as a board, in this process."""

from __future__ import annotations

import threading
from dataclasses import dataclass

from ..clock.host_clock import HostClock, SystemClock
from ..errors import CommandRefusedError, DeviceLostError, PortError
from ..link.base import Played
from ..link.port_text import options_of, parse_pace
from ..wire import messages_gen as wire
from .playback import Playback
from .reader import Recording

FORM = "replay:REC?pace=X&from=S&to=S"
CHUNK_BYTES = 65536


@dataclass(frozen=True)
class ReplayPort:
    """A parsed ``replay:REC?...``; ``pace`` in device seconds per second, 0: unpaced."""

    path: str
    pace: float
    from_s: float
    to_s: float | None


def parse_replay(port: str, pace: float) -> ReplayPort:
    """Split a replay: port; ``pace`` is the default. Raises PortError."""
    path, options = options_of(port, ("pace", "from", "to"), FORM)
    if not path:
        raise PortError(f"{port}: no recording; expected {FORM}")
    try:
        return ReplayPort(
            path,
            parse_pace(options["pace"]) if "pace" in options else pace,
            float(options.get("from", 0.0)),
            float(options["to"]) if "to" in options else None,
        )
    except ValueError as error:
        raise PortError(f"{port}: {error}; an example is replay:press.mcap?pace=1&from=12.5&to=20") from error


def open_replay(port: str, pace: float = 0.0, *, clock: HostClock | None = None) -> ReplayLink:
    """Open a replay: port; ``pace`` is the default. Raises PortError, RecordingError or InputError."""
    parsed = parse_replay(port, pace)
    playback = Playback(Recording(parsed.path), from_s=parsed.from_s, to_s=parsed.to_s)
    return ReplayLink(port, playback, pace=parsed.pace, clock=clock)


class Pacer:
    """When the bytes of a playback are due on a clock; time stands still while nothing plays."""

    def __init__(self, playback: Playback, pace: float, clock: HostClock) -> None:
        self.playback = playback
        self._pace = pace
        self._clock = clock
        self._start_s: float | None = None

    def wait_s(self) -> float | None:
        """Seconds until the next bytes; None when there are none to come for now."""
        due_us = self.playback.next_us() if self.playback.playing else None
        if due_us is None:
            self._start_s = None
            return None
        if self._pace == 0:
            return 0.0
        if self._start_s is None:
            self._start_s = self._clock.monotonic_s() - due_us / 1e6 / self._pace
        return max(0.0, self._start_s + due_us / 1e6 / self._pace - self._clock.monotonic_s())

    def due(self) -> bytes:
        """All that is due now, about CHUNK_BYTES at most."""
        taken = bytearray()
        while len(taken) < CHUNK_BYTES and self.wait_s() == 0.0:
            taken += self.playback.take()
        return bytes(taken)


class ReplayLink:
    """A Link to a ``playback``. Commands that would change a board raise CommandRefusedError."""

    def __init__(self, port: str, playback: Playback, *, pace: float = 0.0, clock: HostClock | None = None) -> None:
        self.port = port
        self.source: Played | None = None
        self.patience = 1.0
        self.ended = False
        self.fd: int | None = None
        self.keeps_time = False
        self.bits_per_s: int | None = None
        self.pace = pace
        self._clock = clock or SystemClock()
        self._pacer = Pacer(playback, pace, self._clock)
        self._answers = b""
        self._answering = threading.Lock()  # commands may come from another thread than the reading one
        self._closed = False

    @property
    def recording(self) -> Recording:
        """What it plays."""
        return self._pacer.playback.recording

    def read(self, timeout_s: float) -> bytes:
        """See Link.read."""
        with self._answering:
            answers, self._answers = self._answers, b""
        if answers:
            return answers
        wait_s = self._pacer.wait_s()
        if wait_s is None:
            self.ended = self._pacer.playback.over
            if not self.ended:
                self._clock.sleep(timeout_s)
            return b""
        if wait_s > 0:
            self._clock.sleep(min(wait_s, timeout_s))
        return self._pacer.due()

    def places(self) -> list[str]:
        """None: a recording does not come back from anywhere."""
        return []

    def reopen(self, place: str) -> None:
        """Never asked for: there are no places."""
        raise PortError(f"{self.port} cannot be opened again; make a new one")

    def write(self, data: bytes) -> None:
        """See Link.write."""
        if self._closed:
            raise DeviceLostError(f"{self.port} was closed; open it again")
        playback = self._pacer.playback
        for message_id, payload in playback.requests(data):
            answer = playback.answer(message_id, payload)
            if answer is None:
                raise CommandRefusedError(
                    f"{self.port} is a recording: {command_name(message_id)} asks for what a board alone can do; "
                    "`biotac recompute` runs its counts with other settings"
                )
            with self._answering:
                self._answers += answer

    def release(self) -> None:
        """See Link.release."""

    def abandon(self) -> None:
        """See Link.abandon."""

    def close(self) -> None:
        """See Link.close."""
        self._closed = True


def command_name(message_id: int) -> str:
    """A command's name, or its number if this library knows none."""
    known = wire.MESSAGES.get(message_id)
    return known.__name__ if known is not None else f"command 0x{message_id:02X}"
