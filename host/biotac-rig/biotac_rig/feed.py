"""Emulated sensors, fed with a Source and queried: those of a simulated gateway, and of biotac-rig's sensor board."""

from __future__ import annotations

import threading
import time

import numpy as np
import numpy.typing as npt

from biotac.board.board import Board
from biotac.board.consumers import Queue
from biotac.errors import DeviceLostError, PortError
from biotac.link import Link
from biotac.sim.fault_gen import EmuFault
from biotac.sim.source import Source
from biotac.wire import messages_gen as wire
from biotac.wire import sensor_gen as sensor
from biotac.wire.identity import board_name

from . import emu_gen as emu

SAMPLES_A_MESSAGE = 110
SAMPLE_BYTES = 2 * SAMPLES_A_MESSAGE
BURST = 16  # messages sent before the board is asked for its status
STILL_S = 60.0
KEPT_SLOTS = 40 * len(sensor.SLOTS)  # of rounds that were put: twice the rounds until send_lost()
REST_S = 0.05  # wait while the board has no room
NOT_HELD = 0xFFFFFFFF


class SensorFeed:
    """The emulated sensors on ``link``. If another board answers, closes ``link`` and raises PortError."""

    def __init__(self, link: Link) -> None:
        self._board = Board(link, messages={**wire.MESSAGES, **emu.MESSAGES})
        self.info = self._board.info
        if self.info.board != wire.BoardKind.PICO_SENSOR:
            seen = board_name(self.info)
            self._board.close()
            raise PortError(f"{link.port} is {seen}, not a sensor board; name the other port, or `biotac flash` it")
        self.serials: tuple[str, ...] = ()  #: of the sensors that are plugged in
        self.held_at = NOT_HELD  #: the slot before which the tape waits
        self._samples: npt.NDArray[np.uint16] = np.zeros((0, 1), np.uint16)
        self._before = 0  # slots of the tape that were sent and are not stored
        self._reports = Queue(self._board.reader)  # of standstills, for listeners

    def plug(self, source: Source) -> None:
        """Plug in as many sensors as ``source`` has fingers, beginning at the first row; then feed()."""
        frames, fingers, slots = source.samples.shape
        self._samples = source.samples.transpose(0, 2, 1).reshape(frames * slots, fingers)
        self.held_at, self._before = NOT_HELD, 0
        own = tuple(f"BTEMU{finger + 1:011d}" for finger in range(fingers))
        self.serials = source.serials + own[len(source.serials) :]
        for finger in range(sensor.MAX_SENSORS):
            serial = self.serials[finger] if finger < fingers else ""
            padded = tuple(serial.encode().ljust(16, b"\0"))
            self._board.ask(emu.EmuPlug(0, finger, finger < fingers, padded), emu.EmuStatus)

    def status(self) -> emu.EmuStatus:
        return self._board.ask(emu.EmuGetStatus(0), emu.EmuStatus)

    def fault(self, finger: int, fault: EmuFault) -> emu.EmuStatus:
        """Give a finger this fault from now on, whatever the tape says; EmuFault.NONE ends it."""
        return self._board.ask(emu.EmuSetFault(0, finger, fault), emu.EmuStatus)

    def play(self, *, hold_slot: int | None = None, by_time: bool = False, live: bool = False) -> emu.EmuStatus:
        """Set how the tape is served, until the next plug().

        Before ``hold_slot``, a round's first, it waits until another play() names a later one or none, and then goes on
        with all fingers in one round. That is for gateways: a reader that never identifies its sensors waits for ever.
        ``by_time``: the tape follows the board's clock, so that rounds are skipped or played again. ``live``: a round
        that has not come when the gateway begins it repeats the one before, and is counted.
        """
        self.held_at = NOT_HELD if hold_slot is None else hold_slot
        return self._board.ask(emu.EmuPlay(0, self.held_at, by_time, live), emu.EmuStatus)

    def feed(self, until_full: bool = False, ended: threading.Event | None = None) -> emu.EmuStatus:
        """Send the other rows as the board has room; return when all is sent, or ``ended`` is set.

        ``until_full``: return also when the board has no more room.
        """
        ended = ended or threading.Event()
        slots, fingers = self._before + len(self._samples), self._samples.shape[1]
        size = SAMPLES_A_MESSAGE // fingers
        status = self.status()
        while status.slots_taken < slots and not ended.is_set():
            at = status.slots_taken
            last = min(slots, at + BURST * size, at + status.room_slots)
            if last - at < min(size, slots - at):
                if until_full:
                    break
                ended.wait(REST_S)
                status = self.status()
                continue
            parts = [(k, min(size, last - k)) for k in range(at, last, size)]
            for first, count in parts[:-1]:
                self._board.send(self._part(first, count))
            status = self._board.ask(self._part(*parts[-1]), emu.EmuStatus)
        return status

    def put(self, words: npt.NDArray[np.uint16]) -> None:
        """Send the next rounds, uint16 (rounds, fingers, 44), without waiting, behind what was sent before."""
        samples = words.transpose(0, 2, 1).reshape(-1, words.shape[1])
        sent, kept = self._before + len(self._samples), self._samples[-KEPT_SLOTS:]
        self._samples, self._before = np.concatenate([kept, samples] if len(kept) else [samples]), sent - len(kept)
        self._send_from(sent)

    def send_lost(self) -> None:
        """Send rounds that were put and have not arrived once more; to be called every 20 rounds.

        Raises DeviceLostError when it is too long ago, as after a restart of the board.
        """
        received = self.status().slots_taken
        if received < self._before:
            raise DeviceLostError(
                f"{self._board.link.port} has {received} slots of its tape, expected {self._before}: it restarted, "
                "or its link lost too much; start another world"
            )
        self._send_from(received)

    def _send_from(self, received: int) -> None:
        slots, size = self._before + len(self._samples), SAMPLES_A_MESSAGE // self._samples.shape[1]
        for first in range(received, slots, size):
            self._board.send(self._part(first, min(size, slots - first)))

    def listen(self) -> None:
        """Collect reports of standstills for wait_still(): each comes once, the first as soon as time is released."""
        self._board.reader.add(self._reports)

    def wait_still(self) -> emu.EmuStatus:
        """Wait until a simulated gateway has computed all rounds, and device time stands still.

        Raises DeviceLostError when it has ended, or takes longer than STILL_S.
        """
        until_s, sent = time.monotonic() + STILL_S, self._before + len(self._samples)
        while time.monotonic() < until_s:
            batch = self._reports.get(wait=True, timeout_s=until_s - time.monotonic())
            self._board.connection.check()
            for message in batch.messages if batch else ():
                if isinstance(message, emu.EmuStatus) and message.req_id == 0 and message.slots_taken == sent:
                    return message
        raise DeviceLostError(f"the simulated board computed nothing for {STILL_S:g} s; start another world")

    def _part(self, first: int, count: int) -> emu.EmuTape:
        data = self._samples[first - self._before : first - self._before + count].astype("<u2").tobytes()
        fingers = self._samples.shape[1]
        return emu.EmuTape(0, fingers, count, first, tuple(data.ljust(SAMPLE_BYTES, b"\0")))

    def close(self) -> None:
        """Give the port back; the board goes on with the rounds that it has."""
        self._board.close()
