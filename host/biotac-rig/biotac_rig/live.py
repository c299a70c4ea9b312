"""An emulated board that a program loads in lock-step."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from biotac.errors import DeviceLostError
from biotac.hand.rounds import Round
from biotac.sim.sampling import Words
from biotac.sim.touch import Load
from biotac.sim.world import PATIENCE_S, LockStep


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
