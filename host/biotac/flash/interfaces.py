"""The interfaces that flashing needs: to a board running its firmware, before and after, and to one in its loader."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from ..hand.hand import Hand
from .families import Family
from .image import Image

#: Called with the number of blocks written so far and the total.
Show = Callable[[int, int], None]


class Loader(Protocol):
    """A way to transfer an image to a board in its loader."""

    #: For messages: "drive RPI-RP2", "picotool".
    name: str

    def ready(self) -> bool:
        """True when a board in its loader can be reached this way. Raises FlashError when there are several."""

    def write(self, image: Image, show: Show) -> None:
        """Transfer the image; the board then restarts by itself. Raises FlashError if not all of it was transferred."""

    def family(self) -> Family | None:
        """The chip of the board in its loader; None when this way does not tell."""
        return None

    def cure(self) -> str:
        """What the user can do when this way is not ready although a board should be there."""


class Target(Protocol):
    """A board on its link, which goes away and comes back."""

    #: For messages.
    port: str

    def port_exists(self) -> bool:
        """True if its port exists, whatever is connected to it."""

    def open(self) -> Hand:
        """Open the board. Raises what biotac.open raises."""

    def touch(self) -> None:
        """Open the port at 1200 baud and close it: the usual way to send a board to its loader."""

    def reopen(self) -> Hand:
        """Wait for the flashed board and open it. Raises DeviceLostError when it does not come back."""

    def close(self) -> None:
        """Release all resources."""
        return
