"""What the rest of the package needs of a link."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Played(Protocol):
    """What a simulated board plays, and what its user would know of it; sim/source.py says more of each."""

    @property
    def name(self) -> str:
        """For messages."""

    @property
    def samples(self) -> NDArray[np.uint16]:
        """(frames, fingers, 44), 0..4095 where a count came."""

    @property
    def settings(self) -> Mapping[str, int]:
        """What to set before streaming, by name in link.toml."""

    @property
    def tare_q4(self) -> NDArray[np.uint16] | None:
        """(fingers, 19) to be given before streaming, or None."""

    @property
    def known_force_n(self) -> NDArray[np.float64] | None:
        """The force that is applied (frames, fingers, 3), or None."""


class Link(Protocol):
    """A byte pipe to a board. Raises DeviceLostError when the board goes away."""

    #: The PORT it was opened as, for messages.
    port: str

    #: What a simulated board plays; None for a real one.
    source: Played | None

    #: The source is over: nothing new will come until a command asks for it.
    ended: bool

    #: Device seconds per second here. 0: device time waits for whoever reads, and nothing need be dropped.
    pace: float

    #: Times as long as a board on a cable it is waited for. More than 1 where the board is a process on this computer:
    #: that is as slow as the computer is busy, and its end is noticed at once.
    patience: float

    #: Its device time is a clock's, which GET_STATUS tells: a recording's is not, nor a time that waits for its reader.
    keeps_time: bool

    #: Of a UART: what it carries. None where messages fit whatever is asked for: USB, a network, this computer.
    bits_per_s: int | None

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

    def abandon(self) -> None:
        """In a child of the process that opened it: let go of what the parent goes on using. Nobody is told."""

    def close(self) -> None:
        """Give the port back. Safe to call twice."""
