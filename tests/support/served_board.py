"""A simulated board as `biotac sim` serves it, for tests that open a port."""

import socket
from typing import Any

from biotac.sim.board import SimBoard
from biotac.sim.serve import Served
from biotac.sim.source import Source


def free_port() -> int:
    """A TCP port of this computer at which nobody listens."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        number: int = free.getsockname()[1]
        return number


class ServedBoard:
    """``path`` is a pty, or with an ``address`` a TCP port of that address. Board time runs, or from ``release`` on."""

    def __init__(self, source: Source, *, pace: float, hold: bool = False, address: str | None = None, **more: Any):
        self.board = SimBoard(source, pace=pace, **more)
        self._served = Served(self.board, address=address)
        self.path = self._served.path
        self.release = self.board.release
        if not hold:
            self.release()

    @property
    def over(self) -> bool:
        return self.board.over

    def close(self) -> None:
        """End it. Safe to call twice."""
        self._served.close()
        self.board.close()
