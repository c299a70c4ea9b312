"""What the rest of the package needs from a link."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..errors import PortError

#: Fingers (n,) and device times (n,) in us to the force (n, 3) in N that was applied: board/reader.py.
AppliedN = Callable[[NDArray[np.uint8], NDArray[np.int64]], NDArray[np.float64] | None]


class Played(Protocol):
    """What a simulated board plays, and what its user would know about it; sim/source.py has the details."""

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

    #: What a simulated board plays; None for a real one.
    source: Played | None = None

    #: Whether the source has ended: nothing new will come until a command asks for it.
    ended: bool = False

    #: Device seconds per second of this computer. 0: device time waits for the reader, and nothing has to be dropped.
    pace: float = 1.0

    #: Whether device time waits for the program that feeds a simulated board's sensors round by round, besides
    #: ``pace`` 0: then nothing needs to wait for a reader.
    lock_step: bool = False

    #: Factor on all timeouts, 1 for a board on a cable. More where the board is a process on this computer: it slows
    #: down when the computer is busy, and its end is noticed at once.
    patience: float = 1.0

    #: Whether device time is a real clock, which GET_STATUS reads. The time of a recording is not, nor one that waits
    #: for its reader.
    keeps_time: bool = True

    #: Whether the board streams to this link alone, so that a STATUS tells what was started here. Not so for
    #: recordings, nor for a board that several share.
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
        """What a user should know of rounds that another driver made, in words, so far."""
        return ()

    @property
    def zero_ns(self) -> int | None:
        """Unix ns of device time 0, by the clock of who stamped the rounds; None: device time is the board's own."""
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

    #: Whether a program that lets device time pass also reads what comes of it (Reader.take): nobody else may wait in
    #: ``read`` then, but in ``await_news``.
    shares_reading: bool = False

    def await_news(self, timeout_s: float) -> None:
        """Wait until there is something to read, for so long."""
        return

    def wake(self) -> None:
        """Let who waits in ``read`` or ``await_news`` return at once, where that can be."""
        return

    def release(self) -> None:
        """Let device time run, if it was held back until the host was ready."""
        return

    def spoilt(self) -> str:
        """What another program did to the port, when that is why nothing can be read any more; empty otherwise."""
        return ""

    def ports(self) -> list[str]:
        """Where the board may be found after it went away, likeliest first; empty when it cannot come back."""
        return []

    def reopen(self, port: str) -> None:
        """Open one of ``ports()`` instead of the lost port. Raises PortError."""
        raise PortError(f"{self.port} cannot be reopened; open a new link")

    def close(self) -> None:
        """Give the port back. Safe to call twice."""
