"""The simulated board: the firmware in this process, with sensors that play a Source or are fed round by round.

The board has its own time (host/binding/sim_board.h). With pace 0 it computes as much as this side reads, and loses
nothing; paced, it runs in a thread that never needs Python's lock. A board's time stands still until ``release``, so
that frame 0 is the source's first row.
"""

from __future__ import annotations

import mmap
import os
import secrets
import threading
import time
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import DeviceLostError, InputError, PortError
from ..link.base import PATIENCE, Link
from ..wire.native import ffi, lib
from ..wire.sensor_gen import MAX_SENSORS, SLOTS
from .source import Source, check_samples

FLASH_BYTES = int(lib.BT_SIM_FLASH_BYTES)
WAIT_S = 0.2  # the longest wait in C, so that Python's signal handlers run
WRITE_S, LOOK_S = 2.0, 0.001  # as a serial port, and between two looks whether there is room
MAX_ROUNDS = 2**32 // len(SLOTS)
#: The most rounds in one step.
STEP_ROUNDS = 50


def _flash(path: Path | None) -> Any:
    """Writable memory of the board's flash: a file's, made if it is not there, or this process's."""
    if path is None:
        return bytearray(b"\xff" * FLASH_BYTES)
    with open(path, "r+b" if path.exists() else "w+b") as file:
        size = os.fstat(file.fileno()).st_size
        if size not in (0, FLASH_BYTES):
            raise PortError(
                f"{path} has {size} bytes, expected {FLASH_BYTES} of a simulated board's flash; name another"
            )
        if size == 0:
            file.write(b"\xff" * FLASH_BYTES)
            file.flush()
        return mmap.mmap(file.fileno(), FLASH_BYTES)


def _slots(words: npt.NDArray[np.uint16]) -> npt.NDArray[np.uint16]:
    """Rounds (n, fingers, 44) as on the sensors' bus, slot by slot."""
    return np.ascontiguousarray(words.transpose(0, 2, 1), "<u2")


def _end(sim: Any, thread: threading.Thread | None, pid: int) -> None:
    if os.getpid() == pid:  # a fork has this board's memory, but no threads
        lib.bt_sim_end(sim)
        if thread is not None:
            thread.join()


def _freeing(pid: int) -> Callable[[Any], None]:
    return lambda sim: lib.bt_sim_free(sim) if os.getpid() == pid else None


class SimBoard:
    """A simulated board, held until ``release``. One host at a time: ``link``, or a program that ``Served`` lets in."""

    def __init__(
        self, source: Source, *, pace: float, live: bool = False, flash: Path | None = None, clock_s: float = 0.0
    ) -> None:
        """Boot it with ``source``'s sensors; ``live``: those are only the first rounds, and ``step`` gives the next.

        ``flash`` is the file with the board's settings and maps; ``clock_s``: the board's time at first. Raises
        PortError for a file that is no flash.
        """
        check_samples(source)
        rounds, fingers, _ = source.samples.shape
        if not 1 <= fingers <= MAX_SENSORS or not 1 <= rounds <= MAX_ROUNDS:
            raise InputError(
                f"source {source.name} has {fingers} fingers and {rounds} rounds, expected 1 to {MAX_SENSORS}, and at "
                f"least one round"
            )
        self.source = source
        self.pace = pace
        self.live = live
        # The board has pointers to these.
        self._flash = _flash(flash)
        self._tape = np.ascontiguousarray(source.samples.transpose(0, 2, 1))
        self._serials = ffi.new("char[]", ",".join(source.serials).encode())
        self._ended = ffi.new("bool *")
        self._out = ffi.new("uint8_t[]", int(lib.BT_SIM_OUTBOX_BYTES))
        facts = ffi.new("bt_sim_facts *")
        facts.flash = ffi.from_buffer("uint8_t[]", self._flash, require_writable=True)
        facts.tape = ffi.NULL if live else ffi.from_buffer("uint16_t[]", self._tape)
        facts.rounds, facts.fingers = rounds, fingers
        facts.serials = self._serials
        facts.boot_id, facts.clock_us = secrets.randbits(32), round(clock_s * 1e6)
        facts.pace = pace
        made = lib.bt_sim_new(facts)
        if made == ffi.NULL:
            raise MemoryError("no memory for a board")
        self._sim = ffi.gc(made, _freeing(os.getpid()))
        thread = None
        if pace > 0:
            thread = threading.Thread(target=lib.bt_sim_serve, args=(self._sim,), name="biotac board", daemon=True)
            thread.start()
        self._finish = weakref.finalize(self, _end, self._sim, thread, os.getpid())
        if live:
            self.step(source.samples)

    @property
    def over(self) -> bool:
        """Whether the source has been played."""
        return bool(lib.bt_sim_over(self._sim))

    def link(self, port: str, *, owned: bool = True) -> SimLink:
        """This board for a Hand, which closes it where it is ``owned``."""
        return SimLink(port, self, owned=owned)

    def release(self) -> None:
        """Let a held board's time run."""
        lib.bt_sim_release(self._sim)

    def restart(self) -> None:
        """Reset the board. Words that it has not sampled are lost; saved settings stay."""
        lib.bt_sim_restart(self._sim)

    def plug(self, up: bool) -> None:
        """Plug the host's cable in, or pull it."""
        lib.bt_sim_plug(self._sim, up)

    def read(self, timeout_s: float) -> bytes:
        """The bytes that the board has sent, waiting for some; an unpaced board computes them.

        Raises DeviceLostError once it is closed.
        """
        if not self._finish.alive:
            raise DeviceLostError("the simulated board was closed; open another")
        n = lib.bt_sim_read(self._sim, self._out, len(self._out), min(timeout_s, WAIT_S), self._ended)
        return bytes(ffi.buffer(self._out, n))

    @property
    def ended(self) -> bool:
        """Whether it was over at the last read, and all bytes had been read."""
        return bool(self._ended[0])

    def receive(self, timeout_s: float | None) -> None:
        """Let this much of the computer's time pass on the board."""
        time.sleep(WAIT_S if timeout_s is None else timeout_s)

    def await_news(self, timeout_s: float) -> None:
        """Wait for so long until there is something to read, or news of the host."""
        lib.bt_sim_await(self._sim, min(timeout_s, WAIT_S))

    def write(self, data: bytes) -> None:
        """Send it bytes. Raises DeviceLostError when it reads nothing for WRITE_S: nobody computes it."""
        until_s = time.monotonic() + WRITE_S
        while data := data[int(lib.bt_sim_write(self._sim, data, len(data))) :]:
            if time.monotonic() > until_s or not self._finish.alive:
                raise DeviceLostError(
                    f"the simulated board has not heard {len(data)} bytes; read it, or let it pass time"
                )
            time.sleep(LOOK_S)

    def wake(self) -> None:
        """Let the next wait, or the one that goes on, end at once."""
        lib.bt_sim_wake(self._sim)

    def step(self, words: npt.NDArray[np.uint16]) -> bytes:
        """Let the sensors' next rounds pass, uint16 (rounds, fingers, 44), at most STEP_ROUNDS; the board's bytes."""
        n = lib.bt_sim_step(self._sim, ffi.from_buffer(_slots(words)), len(words), self._out, len(self._out))
        return bytes(ffi.buffer(self._out, n))

    def put(self, words: npt.NDArray[np.uint16]) -> None:
        """As ``step``, where a program reads the board on its own: it is waited for."""
        slots, rounds = ffi.from_buffer(_slots(words)), len(words)
        while not lib.bt_sim_put(self._sim, slots, rounds, WAIT_S) and self._finish.alive:
            rounds = 0

    def close(self) -> None:
        """End it. Safe to call twice."""
        self._finish()


class SimLink(Link):
    """A link to a simulated board, which it closes where it is ``owned``. While ``away``, the cable is out."""

    patience = PATIENCE

    def __init__(self, port: str, board: SimBoard, *, owned: bool = True) -> None:
        self.port = port
        self.board = board
        self._owned = owned
        self.source = board.source
        self.pace = board.pace
        self.keeps_time = board.pace == 1.0
        self.lock_step = self.shares_reading = board.live
        self.away = False
        self.reopened = False  #: since somebody looked
        self._closed = False

    def ports(self) -> list[str]:
        """The same port: it stays while the board is unplugged or without power."""
        return [self.port]

    def reopen(self, port: str) -> None:
        if self.away:
            raise PortError("the simulated cable is out")
        self.reopened = True

    def read(self, timeout_s: float) -> bytes:
        if self.away:
            raise DeviceLostError("the simulated cable is out")
        if self._closed:
            raise DeviceLostError(f"{self.port} is closed; open it again")
        data = self.board.read(timeout_s)
        self.ended = self.board.ended
        return data

    def await_news(self, timeout_s: float) -> None:
        if not self.away:
            self.board.await_news(timeout_s)

    def write(self, data: bytes) -> None:
        if self._closed or self.away:
            raise DeviceLostError(f"{self.port} {'is closed; open it again' if self._closed else 'is unplugged'}")
        self.board.write(data)

    def wake(self) -> None:
        self.board.wake()

    def release(self) -> None:
        self.board.release()

    def pull(self) -> None:
        """Pull the cable."""
        self.away = True
        self.board.plug(False)
        self.board.wake()

    def push(self) -> None:
        """Put the cable in again."""
        self.board.plug(True)
        self.away = False

    def close(self) -> None:
        self._closed = True
        if self._owned:
            self.board.close()
