"""A Reader of the emulated Nano17 whose time is the simulated board's: no socket, no wall clock."""

from __future__ import annotations

from ..calibrate.reference.rdt import RdtDecoder
from ..calibrate.reference.samples import ReaderStats, Samples
from .nano17 import SENSOR, Nano17
from .source import Source

_DATAGRAM_RECORDS = 20


class Nano17Reader:
    """What the sensor has measured of ``source`` can be read once the board has come as far."""

    def __init__(self, source: Source, finger: int, nano17: Nano17 | None = None) -> None:
        self.nano17 = nano17 or Nano17()
        self._at_s, self._records = self.nano17.records(source, finger)
        self._decoder = RdtDecoder(self.nano17.scale)
        self._next = 0

    @property
    def sensor(self) -> str:
        """What it is."""
        return SENSOR

    @property
    def stats(self) -> ReaderStats:
        """Nothing is lost on this way."""
        its = self._decoder
        return ReaderStats(its.lost, its.late, its.bad + its.refused)

    def read(self, board_s: float) -> Samples:
        """What was measured since the last call."""
        end = int(self._at_s.searchsorted(board_s))
        for begin in range(self._next, end, _DATAGRAM_RECORDS):
            self._decoder.feed(self._records[begin : min(begin + _DATAGRAM_RECORDS, end)].tobytes())
        self._next = max(self._next, end)
        return self._decoder.take()

    def close(self) -> None:
        """Nothing to give back."""
