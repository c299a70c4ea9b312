"""What flashing needs of a way to a board that is in its loader."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from .image import Image

#: Called with the blocks written so far and how many there are.
Show = Callable[[int, int], None]


class Loader(Protocol):
    """One way to hand an image to a board in its loader."""

    #: For messages: "drive RPI-RP2", "picotool".
    name: str

    def ready(self) -> bool:
        """A board in its loader can be reached this way. FlashError when it is more than one."""

    def write(self, image: Image, show: Show) -> None:
        """Hand the image over. The board restarts by itself; FlashError when not all of it went over."""

    def cure(self) -> str:
        """What to do when this way is not ready, though a board should be there."""
