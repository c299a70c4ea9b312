"""What the rest of the package needs of a link."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from ..sim.source import Source


class Link(Protocol):
    """A byte pipe to a board. Raises DeviceLostError when the board goes away."""

    #: The PORT it was opened as, for messages.
    port: str

    #: What a simulated board plays; None for a real one.
    source: Source | None

    #: The source is over: nothing new will come until a command asks for it.
    ended: bool

    #: Device seconds per second here. 0: device time waits for whoever reads, and nothing need be dropped.
    pace: float

    #: Times as long as a board on a cable it is waited for. More than 1 where the board is a process on this computer:
    #: that is as slow as the computer is busy, and its end is noticed at once.
    patience: float

    #: What can be read in place of ``read``: a file descriptor that gives the same bytes, and OSError when the board
    #: goes away. None where there is none, or ``read`` does more.
    fd: int | None

    def read(self, timeout_s: float) -> bytes:
        """Return all bytes that are there, waiting up to timeout_s for the first; may be empty."""

    def write(self, data: bytes) -> None:
        """Send all of data."""

    def release(self) -> None:
        """Let device time run, if it was held until the host was ready."""

    def places(self) -> list[str]:
        """Where the board may be found after it went away, likeliest first; nowhere when it cannot come back."""

    def reopen(self, place: str) -> None:
        """Open one of ``places`` in place of the lost port. Raises PortError."""

    def close(self) -> None:
        """Give the port back. Safe to call twice."""
