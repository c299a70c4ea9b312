"""The interface that flashing needs to a board running its firmware, before and after."""

from __future__ import annotations

from typing import Protocol

from ..hand.hand import Hand


class Target(Protocol):
    """A board on its link, which goes away and comes back."""

    #: For messages.
    port: str

    def there(self) -> bool:
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
