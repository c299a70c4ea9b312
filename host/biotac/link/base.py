"""The link, as the rest of the package sees it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import PortError

#: Fingers (n,) and device times (n,) in us to the force (n, 3) in N that was applied: board/reader.py.
AppliedN = Callable[[NDArray[np.uint8], NDArray[np.int64]], NDArray[np.float64] | None]


class Played(Protocol):
    """The source of a simulated board, with the facts that its user would know; sim/source.py has the details."""

    @property
    def tare_q4(self) -> NDArray[np.uint16] | None:
        """The tare (fingers, 19) to give the board before streaming, in 1/16 count, or None."""

    def applied_n(self, finger: NDArray[np.uint8], since_us: NDArray[np.int64]) -> NDArray[np.float64] | None:
        """Force (n, 3) in N on fingers (n,) in rounds ``since_us`` (n,) after round 0; NaN outside, None if unknown."""


#: Of a board that is a program on this computer.
PATIENCE = 60.0


class Link(Protocol):
    """A byte pipe to a board. Raises DeviceLostError when the board goes away. The defaults here suit a real board."""

    #: The PORT that was opened, for messages.
    port: str

    #: The source of a simulated board; None for a real one.
    source: Played | None = None

    #: Whether the source has ended: nothing new will come until a command asks for it.
    ended: bool = False

    #: Device seconds per second of this computer. 0: device time waits for the reader, and nothing has to be dropped.
    pace: float = 1.0

    #: Whether device time waits for the program that feeds a simulated board's sensors round by round, besides
    #: ``pace`` 0: then nothing needs to wait for a reader.
    lock_step: bool = False

    #: Factor on all timeouts, 1 for a board on a cable. More where the board is a process on this computer: it slows
    #: down when the computer is busy, and its death is noticed at once.
    patience: float = 1.0

    #: Whether device time is a real clock, which GET_STATUS reads. False for a recording and for an unpaced board.
    keeps_time: bool = True

    #: Whether the board streams to this link alone, so that a STATUS shows the streams started here. False for a
    #: recording and for a shared board.
    owns_stream: bool = True

    def follow_loads(self) -> None:
        """From now on, device time is known to wait for the program that feeds a simulated board's sensors."""
        self.pace, self.lock_step, self.keeps_time, self.patience = 0.0, True, False, PATIENCE

    def applied_n(
        self, finger: NDArray[np.uint8], t_us: NDArray[np.int64], round0_us: int | None
    ) -> NDArray[np.float64] | None:
        """Force (n, 3) in N on fingers (n,) at device times (n,), if round 0 was at ``round0_us``; None if unknown."""
        return None if self.source is None or round0_us is None else self.source.applied_n(finger, t_us - round0_us)

    @property
    def notes(self) -> Sequence[str]:
        """Facts for the user about rounds that another driver made, in words, so far."""
        return ()

    @property
    def zero_ns(self) -> int | None:
        """Unix ns of device time 0, by the clock of another driver; None: device time is the board's own."""
        return None

    #: The bit rate of a UART. None where everything fits: USB, a network, this computer.
    bits_per_s: int | None = None

    #: A file descriptor to read in place of ``read``: it gives the same bytes, and OSError when the board goes away.
    #: None where there is none, or where ``read`` does more.
    fd: int | None = None

    def read(self, timeout_s: float) -> bytes:
        """Return all bytes that have arrived, waiting up to timeout_s for the first; may be empty."""

    def write(self, data: bytes) -> None:
        """Send all of data."""

    #: Whether a program that advances device time also reads the result (Reader.take): then nobody else may wait in
    #: ``read``, only in ``await_news``.
    shares_reading: bool = False

    def await_news(self, timeout_s: float) -> None:
        """Wait until there is something to read, for so long."""
        return

    def wake(self) -> None:
        """Make a wait in ``read`` or ``await_news`` return at once, where that is possible."""
        return

    def release(self) -> None:
        """Let device time run, if it was held back until the host was ready."""
        return

    def spoilt(self) -> str:
        """How another program spoilt the port, when nothing can be read any more for that reason; empty otherwise."""
        return ""

    def ports(self) -> list[str]:
        """Where the board may be found after it went away, likeliest first; empty when it cannot come back."""
        return []

    def reopen(self, port: str) -> None:
        """Open one of ``ports()`` instead of the lost port. Raises PortError."""
        raise PortError(f"{self.port} cannot be reopened; open a new link")

    def close(self) -> None:
        """Give the port back. Safe to call twice."""
