"""The interface that the page needs to whatever it shows, from opening it until it ends or is lost."""

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
    """Yields batches and takes commands meanwhile. Used by one thread only."""

    #: The sender, as text for users: board and firmware.
    board: str

    #: True for a board, which can be tared and recorded; False for a recording, which can be paused.
    live: bool

    #: True while paused, until ``resume``.
    paused: bool

    def batches(self) -> Iterator[Batch]:
        """Yield batches as time goes on, at least one per second, if need be an empty one; return at the end."""

    def stats(self) -> LinkStats:
        """Health of the link."""

    def recording(self) -> Recorded | None:
        """The recording being written now, if any."""

    def do(self, command: str, finger: int | None) -> str:
        """Carry out a command of ``COMMANDS``; return what was done, in words.

        Raises InputError for a command that this player does not support, any BiotacError for one that failed.
        """

    def close(self) -> None:
        """Release all resources. Safe to call twice."""


Opener = Callable[[], Player]

#: Commands of the page. ``again`` replays from the start after the end; it never reaches a Player.
COMMANDS = ("tare", "record", "stop", "pause", "resume", "again")
