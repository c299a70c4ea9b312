"""What flashing needs of a board that runs its firmware, before and after."""

from __future__ import annotations

from typing import Protocol

from ..hand.hand import Hand


class Target(Protocol):
    """The board on its link, which goes away and comes back."""

    #: For messages.
    port: str

    def there(self) -> bool:
        """Its port exists, whatever is behind it."""

    def open(self) -> Hand:
        """Shake hands. Raises what biotac.open raises."""

    def touch(self) -> None:
        """Open the port at 1200 baud and close it: the customary way into a loader."""

    def reopen(self) -> Hand:
        """Wait for the board that was flashed and shake hands. DeviceLostError when it does not come back."""

    def close(self) -> None:
        """Give everything back."""
