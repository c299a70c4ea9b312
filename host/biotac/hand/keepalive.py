"""Signs of life while a board streams: pings for the board, so that it stops when this host has died, and an end to
waiting for one that is silent."""

from __future__ import annotations

import math

from ..errors import DeviceLostError
from ..wire import messages_gen as wire
from .board import Board

# A streaming board sends a status every second by default; three missing ones are a dead link.
SILENCE_S = 3.0
LAST_LOOK_S = 1.0  # before it is called silent
# A board whose live host has died stops streaming after this long.
KEEPALIVE_S = 1.0
PINGS_PER_KEEPALIVE = 3
# Every so often a ping is a question for the board's time.
ASK_TIME_S = 0.5


class KeepAlive:
    """Of one board; whoever reads it calls ``serve`` between reads, and ``heard`` with what came."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self._link = board.link
        self._monotonic_s = board.host_clock.monotonic_s
        self._heard_s = self._ping_due_s = self._monotonic_s()
        self._due_s = -math.inf  # until when there is nothing to do but read
        self._ask_due_s = -math.inf

    def start(self) -> None:
        """The board was told to stream."""
        self._heard_s = self._monotonic_s()
        self._due_s = self._ping_due_s = self._heard_s + KEEPALIVE_S / PINGS_PER_KEEPALIVE
        self._ask_time()

    def heard(self) -> float:
        """The board said something, or was not the one that was silent; returns the time."""
        self._heard_s = self._monotonic_s()
        return self._heard_s

    def timeout_ms(self, live: bool) -> int:
        """What START tells the board; 0 is none. ``live``: a thread reads always, and so can ping."""
        # In device time, which a simulated board can let run fast; one that waits for its reader knows no dead host.
        if not live or self._link.pace == 0:
            return 0
        return min(0xFFFF, round(1000 * KEEPALIVE_S * max(1.0, self._link.pace)))

    def silence_s(self) -> float:
        """How long a board that streams may be silent."""
        return SILENCE_S * self._link.patience

    def lose(self) -> None:
        """It was silent for too long."""
        silent = f"{self._link.port} has been silent for {self.silence_s():.0f} s while streaming"
        self._board.lost(DeviceLostError(f"{silent}; check the cable and open it again"), "silence")

    def serve(self, live: bool) -> float:
        """Do what is due while it streams; returns for how many s there is nothing more to do."""
        now_s = self._monotonic_s()
        if now_s < self._due_s:
            return self._due_s - now_s
        if now_s - self._heard_s >= self.silence_s():
            # It may be this side that was away, stopped or asleep: what waits to be read comes first.
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
        """A round trip for the clock; False when it is too early for another, or the link keeps no time."""
        due = self._monotonic_s() >= self._ask_due_s and self._link.keeps_time
        if due:
            self._ask_time()
        return due

    def _ask_time(self) -> None:
        self._ask_due_s = self._monotonic_s() + ASK_TIME_S
        if self._link.keeps_time:
            self._board.ask_time()
