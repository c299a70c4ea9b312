"""ATI's RDT messages (Net F/T and similar): encodes requests, decodes records in order. No socket, no clock.

Source: ATI manual 9620-05-NET FT, section 9. A request is eight bytes; a datagram holds one record of 36 bytes, or
many in the buffered mode. UDP loses, duplicates and reorders datagrams. A record's number in the stream says when it
was taken, so time is the box's own and a gap stays a gap.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...errors import DeviceLostError, InputError
from ...wire.counters import nearest
from .samples import Samples

PORT = 49152
MAGIC = 0x1234
STOP, START, START_BUFFERED = 0x0000, 0x0002, 0x0003
ENDLESS = 0
ERROR_BIT = 0x8000_0000  # of the status: the reading is not valid
NMM_PER_NM = 1000.0

REQUEST = struct.Struct(">HHI")
RECORD_DTYPE = np.dtype([("rdt_sequence", ">u4"), ("ft_sequence", ">u4"), ("status", ">u4"), ("counts", ">i4", (6,))])

# Records held back for late ones. Neighbours swap places on a network; a record that is later than this is lost.
HOLD_RECORDS = 64
RESTART_RECORDS = 500  # a record this far behind is not late: the box has restarted its numbers


@dataclass(frozen=True)
class Scale:
    """The box's configuration: counts per N and per N mm, and records per second."""

    counts_per_n: float
    counts_per_nmm: float
    rate_hz: float

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 < value < float("inf"):
                raise InputError(f"{name} is {value}: expected a number above 0; see the box's configuration page")


def request(command: int, records: int = ENDLESS) -> bytes:
    """A request's bytes; with 0 ``records`` the box sends until STOP."""
    return REQUEST.pack(MAGIC, command, records)


class RdtDecoder:
    """Decodes datagrams into samples in order.

    It counts records that were ``lost`` or came too ``late`` or twice, datagrams ``refused`` for their size, and
    ``bad`` readings with the error bit, which are NaN.
    """

    def __init__(self, scale: Scale) -> None:
        self.scale = scale
        self.lost = self.late = self.refused = self.bad = 0
        self._waiting: list[tuple[npt.NDArray[np.int64], npt.NDArray[np.void]]] = []
        self._newest: int | None = None
        self._released = -1

    def feed(self, datagram: bytes) -> None:
        """Take one datagram. Raises DeviceLostError when the box has restarted its numbers."""
        size = RECORD_DTYPE.itemsize
        if not datagram or len(datagram) % size:
            self.refused += 1
            return
        records = np.frombuffer(datagram, RECORD_DTYPE)
        numbers = np.empty(len(records), np.int64)
        for k, raw in enumerate(records["rdt_sequence"].tolist()):
            newest = raw if self._newest is None else self._newest
            numbers[k] = nearest(raw, newest, 32)
            if numbers[k] < newest - RESTART_RECORDS:
                raise DeviceLostError(
                    f"the force sensor's record number went from {newest} to {raw}: expected the next; it restarted or "
                    "another program restarted its stream: close that program and start again"
                )
            self._newest = max(newest, int(numbers[k]))
        self._waiting.append((numbers, records))

    def take(self, *, all_of_them: bool = False) -> Samples:
        """The samples that are in order by now; with ``all_of_them`` also those held back."""
        if not self._waiting:
            return Samples(np.empty(0), np.empty((0, 6)))
        numbers = np.concatenate([n for n, _ in self._waiting])
        records = np.concatenate([r for _, r in self._waiting])
        order = np.argsort(numbers, kind="stable")
        numbers, records = numbers[order], records[order]
        fresh = (numbers > self._released) & np.concatenate([[True], np.diff(numbers) > 0])
        self.late += int((~fresh).sum())
        numbers, records = numbers[fresh], records[fresh]
        assert self._newest is not None
        ready = numbers <= self._newest - (0 if all_of_them else HOLD_RECORDS)
        self._waiting = [(numbers[~ready], records[~ready])] if (~ready).any() else []
        numbers, records = numbers[ready], records[ready]
        if len(numbers):
            if self._released >= 0:
                self.lost += int(numbers[0]) - self._released - 1
            self.lost += int(numbers[-1] - numbers[0]) + 1 - len(numbers)
            self._released = int(numbers[-1])
        wrench = records["counts"] / np.array([self.scale.counts_per_n] * 3 + [self.scale.counts_per_nmm] * 3)
        wrong = (records["status"] & ERROR_BIT) != 0
        self.bad += int(wrong.sum())
        wrench[wrong] = np.nan
        return Samples(numbers / self.scale.rate_hz, wrench)
