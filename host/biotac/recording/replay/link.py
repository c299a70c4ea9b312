"""A recording played back as a board, in this process."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from ...clock.host_clock import HostClock
from ...errors import CommandRefusedError, DeviceLostError, PortError
from ...link.base import Link
from ...link.port_text import file_and_options, parse_pace
from ...wire.identity import command_name
from ..reader import Recording
from .playback import Playback

FORM = "replay:REC?pace=X&from=S&to=S"
CHUNK_BYTES = 65536


def open_replay(port: str, pace: float = 0.0, *, clock: HostClock | None = None) -> ReplayLink:
    """Open a replay: port. ``pace`` is the default pace in device seconds per second; 0: unpaced.

    Raises PortError, RecordingError or InputError.
    """
    path, options = file_and_options(port, ("pace", "from", "to"), FORM)
    try:
        pace = parse_pace(options["pace"]) if "pace" in options else pace
        from_s = float(options.get("from", 0.0))
        to_s = float(options["to"]) if "to" in options else None
    except ValueError as error:
        raise PortError(f"{port}: {error}; an example is replay:press.mcap?pace=1&from=12.5&to=20") from error
    return ReplayLink(port, Playback(Recording(path), from_s=from_s, to_s=to_s), pace=pace, clock=clock)


class Pacer:
    """Decides when the bytes of a playback are due on a clock. Time stands still while nothing plays."""

    def __init__(self, playback: Playback, pace: float, clock: HostClock) -> None:
        self.playback = playback
        self.paused = False  # set from any thread, as is pace
        self.pace = pace
        self._clock = clock
        self._start: tuple[float, float] | None = None  # a pace, and when 0 of device time would have been at it

    def wait_s(self) -> float | None:
        """Seconds until the next bytes are due; None when none are due for now."""
        due_us = self.playback.next_us() if self.playback.playing and not self.paused else None
        if due_us is None:
            self._start = None
            return None
        pace, start = self.pace, self._start
        if pace == 0:
            return 0.0
        if start is None or start[0] != pace:
            start = self._start = pace, self._clock.monotonic_s() - due_us / 1e6 / pace
        return max(0.0, start[1] + due_us / 1e6 / pace - self._clock.monotonic_s())

    def due(self) -> bytes:
        """All bytes due now, up to about CHUNK_BYTES."""
        data = bytearray()
        while len(data) < CHUNK_BYTES and self.wait_s() == 0.0:
            data += self.playback.pop()
        return bytes(data)


class ReplayLink(Link):
    """A Link to a ``playback``. Commands that would change a board raise CommandRefusedError."""

    keeps_time = False
    owns_stream = False

    def __init__(self, port: str, playback: Playback, *, pace: float = 0.0, clock: HostClock | None = None) -> None:
        self.port = port
        self.pace = pace
        self._clock = clock or HostClock()
        self.pacer = Pacer(playback, pace, self._clock)
        self._answers = b""
        self._answering = threading.Lock()  # commands may come from a thread other than the reader
        self._commanded = threading.Event()
        self._closed = False

    @property
    def recording(self) -> Recording:
        return self.pacer.playback.recording

    def applied_n(
        self, finger: NDArray[np.uint8], t_us: NDArray[np.int64], round0_us: int | None
    ) -> NDArray[np.float64] | None:
        return None if self.recording.applied_n is None else self.recording.applied_at(finger, t_us)

    def read(self, timeout_s: float) -> bytes:
        with self._answering:
            answers, self._answers = self._answers, b""
        if answers:
            return answers
        wait_s = self.pacer.wait_s()
        if wait_s is None:
            had_ended, self.ended = self.ended, self.pacer.playback.over
            if self.ended == had_ended and self._commanded.wait(timeout_s):
                self._commanded.clear()
            return b""
        if wait_s > 0:
            self._clock.sleep(min(wait_s, timeout_s))
        return self.pacer.due()

    def write(self, data: bytes) -> None:
        if self._closed:
            raise DeviceLostError(f"{self.port} was closed; open it again")
        playback = self.pacer.playback
        for message_id, payload in playback.requests(data):
            answer = playback.answer(message_id, payload)
            if answer is None:
                raise CommandRefusedError(
                    f"{self.port} is a recording: {command_name(message_id)} needs a board; "
                    "to try other settings on its counts, use `biotac export --recompute`"
                )
            with self._answering:
                self._answers += answer
            self._commanded.set()

    def close(self) -> None:
        self._closed = True
