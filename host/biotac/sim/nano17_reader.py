"""A Reader of the emulated Nano17 that runs on the simulated board's time: no socket, no wall clock."""

from __future__ import annotations

from ..calibrate.reference.rdt import RdtDecoder
from ..calibrate.reference.samples import ReaderStats, Samples
from .nano17 import SENSOR, Nano17
from .source import Source

_DATAGRAM_RECORDS = 20


class Nano17Reader:
    """Reads what the sensor measures of ``source``, up to the board's current time."""

    sensor = SENSOR

    def __init__(self, source: Source, finger: int, nano17: Nano17 | None = None) -> None:
        self.nano17 = nano17 or Nano17()
        self._at_s, self._records = self.nano17.records(source, finger)
        self._decoder = RdtDecoder(self.nano17.scale)
        self._next = 0

    @property
    def stats(self) -> ReaderStats:
        """Counters of records lost, late and bad; nothing is lost here."""
        its = self._decoder
        return ReaderStats(its.lost, its.late, its.bad + its.refused)

    def read(self, board_s: float) -> Samples:
        """Samples measured since the last call, up to board time ``board_s``."""
        end = int(self._at_s.searchsorted(board_s))
        for begin in range(self._next, end, _DATAGRAM_RECORDS):
            self._decoder.feed(self._records[begin : min(begin + _DATAGRAM_RECORDS, end)].tobytes())
        self._next = max(self._next, end)
        return self._decoder.take()
