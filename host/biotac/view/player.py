"""What the page needs of whatever it shows: one playing, from its opening to its end or loss."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

from ..wire.batches import Batch, LinkStats


@dataclass(frozen=True)
class Recorded:
    """A recording being written."""

    path: str
    seconds: float  # device time since it began


class Player(Protocol):
    """Batches, and what can be done meanwhile. Used by one thread only."""

    #: Who sends, for a person: board, firmware, serial number.
    board: str

    #: A board is there: it can be tared and recorded. Otherwise it can be paused.
    live: bool

    #: Playing stands still until ``resume``.
    paused: bool

    def batches(self) -> Iterator[Batch]:
        """Yield batches as time goes on, empty ones at least every second; return when it is over."""

    def stats(self) -> LinkStats:
        """Health of the link."""

    def recording(self) -> Recorded | None:
        """What is being written now."""

    def do(self, command: str, finger: int | None) -> str:
        """Carry out a command of ``COMMANDS``; return what was done, in words.

        Raises InputError for one that makes no sense here, any BiotacError for one that failed.
        """

    def close(self) -> None:
        """Give everything back. Safe to call twice."""


Opener = Callable[[], Player]

#: What the page may ask for. ``again`` plays from the start what is over; it never reaches a Player.
COMMANDS = ("tare", "record", "stop", "pause", "resume", "again")
