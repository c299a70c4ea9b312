"""Signs of life while a board streams: pings for the board, which stops when this host has died, and a limit to how
long a silent board is waited for."""

from __future__ import annotations

import math

from ..errors import DeviceLostError
from ..wire import messages_gen as wire
from .board import Board

# A streaming board sends a status every second by default; three missing ones mean a dead link.
SILENCE_S = 3.0
LAST_LOOK_S = 1.0  # before the board is called silent
# A board stops streaming this long after its live host has died.
KEEPALIVE_S = 1.0
PINGS_PER_KEEPALIVE = 3
# This often, a ping is a question for the board's time instead.
ASK_TIME_S = 0.5


class KeepAlive:
    """Of one board; the thread that reads it calls ``serve`` between reads, and ``heard`` for each batch."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self._link = board.link
        self._monotonic_s = board.host_clock.monotonic_s
        self._heard_s = self._ping_due_s = self._monotonic_s()
        self._due_s = -math.inf  # until then there is nothing to do but read
        self._ask_due_s = -math.inf

    def start(self) -> None:
        """Start counting: the board was told to stream."""
        self._heard_s = self._monotonic_s()
        self._due_s = self._ping_due_s = self._heard_s + KEEPALIVE_S / PINGS_PER_KEEPALIVE
        self._ask_time()

    def heard(self) -> float:
        """Note that the board sent something, or that the silence was not the board's; returns the time."""
        self._heard_s = self._monotonic_s()
        return self._heard_s

    def timeout_ms(self, live: bool) -> int:
        """The keep-alive time for START; 0 is none. ``live``: threads read all the time, and so can ping."""
        # In device time, which may run fast on a simulated board. One that waits for its reader needs no keep-alive.
        if not live or self._link.pace == 0:
            return 0
        return min(0xFFFF, round(1000 * KEEPALIVE_S * max(1.0, self._link.pace)))

    def silence_s(self) -> float:
        """How long a streaming board may be silent, s."""
        return SILENCE_S * self._link.patience

    def lose(self) -> None:
        """Report the board as lost: it was silent for too long."""
        silent = f"{self._link.port} has been silent for {self.silence_s():.0f} s while streaming"
        self._board.lost(DeviceLostError(f"{silent}; check the cable and open it again"), "silence")

    def serve(self, live: bool) -> float:
        """Do what is due while the board streams; returns for how many s there is nothing more to do."""
        now_s = self._monotonic_s()
        if now_s < self._due_s:
            return self._due_s - now_s
        if now_s - self._heard_s >= self.silence_s():
            # This side may have been stopped or asleep: read first what is waiting.
            self._board.read(LAST_LOOK_S)
            now_s = self._monotonic_s()
        if now_s - self._heard_s >= self.silence_s():
            self.lose()
            now_s = self.heard()
        self._due_s = self._heard_s + self.silence_s()
        if self.timeout_ms(live):
            if now_s >= self._ping_due_s:
                self._ping_due_s = now_s + KEEPALIVE_S / PINGS_PER_KEEPALIVE
                self._ping()
            self._due_s = min(self._ping_due_s, self._due_s)
        return self._due_s - now_s

    def _ping(self) -> None:
        try:
            if not self.ask_time_if_due():
                self._board.send(wire.Ping(0))
        except DeviceLostError as error:
            self._board.lost(error, "unplugged")

    def ask_time_if_due(self) -> bool:
        """Start a round trip for the clock; false when it is too early for one, or the link keeps no time."""
        due = self._monotonic_s() >= self._ask_due_s and self._link.keeps_time
        if due:
            self._ask_time()
        return due

    def _ask_time(self) -> None:
        self._ask_due_s = self._monotonic_s() + ASK_TIME_S
        if self._link.keeps_time:
            self._board.ask_time()
