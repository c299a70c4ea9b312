"""Rounds of SynTouch's .btd text files, with their own times and serial numbers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from ...recording.btd.file import read_btd
from ...wire import slots
from ...wire.sensor_gen import MAX_SENSORS
from .message import SLOT_US, Counts, Message


class Btd:
    """The complete frames of a file; the first is at 0. Raises RecordingError naming the line."""

    live = False

    def __init__(self, path: Path) -> None:
        self.read = read_btd(path)

    def __iter__(self) -> Iterator[Message]:
        read = self.read
        for time_s, row in zip(read.t_s - read.t_s[0], read.samples.astype(int), strict=True):
            own = []
            for words, serial in zip(row, read.serials, strict=True):
                pdc, tac, tdc = (int(words[slot]) for slot in slots.SLOW_SLOTS.values())
                own.append(Counts(words[slots.ELECTRODE_SLOT], pdc, tac, tdc, words[slots.PAC_SLOT], serial))
            yield Message(round(time_s * 1e9), (*own, *[None] * (MAX_SENSORS - len(own))), SLOT_US)
