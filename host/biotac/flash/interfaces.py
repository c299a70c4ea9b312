"""The interfaces that flashing needs: to a board running firmware, before and after, and to one in the loader."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from ..hand.hand import Hand
from .families import Family
from .image import Image

#: Called with the number of blocks written so far and the total.
Show = Callable[[int, int], None]


class Loader(Protocol):
    """A way to transfer an image to a board in the loader."""

    #: For messages: "drive RPI-RP2", "picotool".
    name: str

    def ready(self) -> bool:
        """True when a board in its loader can be reached this way. Raises FlashError when there are several."""

    def write(self, image: Image, show: Show) -> None:
        """Transfer the image; the board then restarts by itself. Raises FlashError if the transfer is incomplete."""

    def family(self) -> Family | None:
        """The chip of the board in the loader; None when this way cannot tell."""
        return None

    def cure(self) -> str:
        """The user's cure when this way is not ready although a board should be there."""


class Target(Protocol):
    """A board on a link that goes away and comes back."""

    #: For messages.
    port: str

    def port_exists(self) -> bool:
        """True if the port exists, with any or no board on it."""

    def open(self) -> Hand:
        """Open the board. Raises as biotac.open."""

    def touch(self) -> None:
        """Open the port at 1200 baud and close it: the usual way to send a board to the loader."""

    def reopen(self) -> Hand:
        """Wait for the flashed board and open it. Raises DeviceLostError when it does not come back."""

    def close(self) -> None:
        """Release all resources."""
        return
