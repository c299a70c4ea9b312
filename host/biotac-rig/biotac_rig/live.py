"""An emulated board that a program loads in lock-step: bytes are counted, as it is another process."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Any

from biotac.errors import DeviceLostError
from biotac.hand.rounds import Round
from biotac.sim.emu_gen import EmuStatus
from biotac.sim.sampling import Words
from biotac.sim.touch import Load
from biotac.sim.world import PATIENCE_S, LockStep

from .process import ProcessBoard, ProcessLink


class LiveLink(ProcessLink):
    """The link to a live board; it knows when all bytes of the board were passed on to the hand."""

    lock_step = True

    def __init__(self, port: str, board: ProcessBoard) -> None:
        self._passed_on = threading.Condition()
        self._read_bytes = self._passed_bytes = self._before_bytes = 0
        super().__init__(port, board)

    def read(self, timeout_s: float) -> bytes:
        with self._passed_on:
            self._passed_bytes = self._read_bytes  # a reader that reads on has passed on the bytes before
            self._passed_on.notify_all()
        chunk = super().read(timeout_s)
        self._read_bytes += len(chunk)
        return chunk

    def count_from(self, status: EmuStatus) -> None:
        """All bytes of the board up to ``status`` have been read, and are on their way to the hand."""
        self._before_bytes = status.link_bytes - self._read_bytes

    def wait_passed_on(self, status: EmuStatus, timeout_s: float) -> bool:
        """Wait until the hand has all bytes of the board up to ``status``; false when that needs too long."""
        most = (status.link_bytes - self._before_bytes) % 2**32
        with self._passed_on:
            return self._passed_on.wait_for(lambda: (self._passed_bytes - most) % 2**32 < 2**31, timeout_s)


class EmulatedWorld(LockStep):
    """LockStep on an emulated board, without the faults of a board in this process."""

    def __init__(self, *given: Any) -> None:
        super().__init__(*given)
        self._counts = False

    def _next(self, rounds: int, loads: Mapping[str, Load]) -> Round:
        self._advance(self._fingers.read(loads, rounds))
        if self._rounds is None:
            return Round(-1, -1, 0, {}, ())
        return self._rounds.pop()

    def _advance(self, words: Words) -> None:
        """Let these rounds pass, and wait until device time stands still, and the hand has all bytes."""
        board: Any = self._board
        link: Any = self.hand.link if self.hand is not None else None
        if link is not None and not self._counts:
            self._counts = True
            self.hand.ping()  # the reply is the last that has come
            link.count_from(board.sensors.status())
        board.sensors.put(words)
        status, until_s = board.sensors.wait_still(), time.monotonic() + PATIENCE_S
        while link is not None and not link.wait_passed_on(status, 0.5):
            self.hand.check()
            if time.monotonic() > until_s:
                raise DeviceLostError("what the emulated board sent did not arrive; start another world")
