"""Force/torque sensors read while they measure.

A Reader gives whatever has come since it was asked last, never waits, and keeps its sensor's own time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from .samples import Samples


@dataclass(frozen=True)
class ReaderStats:
    """Samples that never came, came too late or twice, and that the sensor itself called bad."""

    lost: int
    late: int
    bad: int


class Reader(Protocol):
    """``sensor`` is its name and number as far as it says them."""

    @property
    def sensor(self) -> str:
        """For people and for provenance."""

    @property
    def stats(self) -> ReaderStats:
        """Counts so far."""

    def read(self, board_s: float) -> Samples:
        """Samples since the last call, six axes, in order. Raises DeviceLostError when the sensor has gone.

        ``board_s`` is how long the board has streamed by its own clock: what an emulated sensor goes by.
        """

    def close(self) -> None:
        """Safe to call twice."""
