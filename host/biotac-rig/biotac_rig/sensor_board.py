"""The emulated sensors as a board of their own (firmware/sensor_board), beside a gateway's.

The board serves the tape in order, a sample for each sample command. It stores 3.5 s of five fingers, 17 s of one.
"""

from __future__ import annotations

import threading
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from biotac.errors import BiotacError, DeviceLostError, InputError
from biotac.wire import sensor_gen as sensor

from . import emu_gen as emu
from .feed import REST_S, SensorFeed

KEEP_S = 20.0  # 39 sectors of flash, each at the longest time


class SensorBoard(SensorFeed):
    """The sensor board on ``link``. If another board answers, closes ``link`` and raises PortError."""

    def keep(self) -> emu.EmuStatus:
        """Store the whole plugged source in the board's flash, to be played in a loop from power-up on.

        It must fit the board's memory at once, 3.5 s of five fingers. Raises InputError when it does not, and
        CommandRefusedError when the board has lost some of it.
        """
        slots, fingers = self._samples.shape
        received = self.feed(until_full=True).slots_taken
        if received < slots:
            tape_s, room_s = slots / sensor.SLOT_HZ, received / sensor.SLOT_HZ
            raise InputError(
                f"{tape_s:g} s of {fingers} fingers do not fit the board: expected up to {room_s:g} s; shorten it"
            )
        digest = zlib.crc32(self._samples.astype("<u2").tobytes())
        status = self._board.ask(emu.EmuKeep(0, slots, digest), emu.EmuStatus)
        until_s = time.monotonic() + KEEP_S * self._board.link.patience
        while status.loop_slots != slots:
            if time.monotonic() > until_s:
                raise DeviceLostError(
                    f"{self._board.link.port}: the tape was not written within {KEEP_S:g} s; try again"
                )
            time.sleep(REST_S)
            status = self.status()
        return status

    def forget(self) -> emu.EmuStatus:
        """Erase the tape in flash."""
        return self._board.ask(emu.EmuKeep(0, 0, 0), emu.EmuStatus)

    @contextmanager
    def feeding(self) -> Iterator[emu.EmuStatus]:
        """Feed the board in a thread meanwhile; yields the status when the board's room was full for the first time.

        If the board goes away, the next request to it raises the error.
        """
        ended = threading.Event()

        def feed() -> None:
            with suppress(BiotacError):
                self.feed(ended=ended)

        full = self.feed(until_full=True)
        thread = threading.Thread(target=feed, name="biotac sensor board", daemon=True)
        thread.start()
        try:
            yield full
        finally:
            ended.set()
            thread.join()
