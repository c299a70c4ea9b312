"""The interface that flashing needs to reach a board in its loader."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

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

    def cure(self) -> str:
        """What the user can do when this way is not ready although a board should be there."""
