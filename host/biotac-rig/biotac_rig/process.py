"""A board that is another process: an emulated image's, in Node or QEMU, on a pty, playing a Source.

The board has its own time. With pace 0 it runs as fast as this side reads, and loses nothing. A held board's time
stands still until ``release``, so that frame 0 is the source's first row.
"""

from __future__ import annotations

import os
import select
import shlex
import shutil
import subprocess
import tempfile
import threading
from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from biotac.errors import DeviceLostError, PortError
from biotac.link.base import PATIENCE
from biotac.link.serial_port import SerialLink
from biotac.sim.source import Source

from .emu_gen import EmuStatus
from .feed import SensorFeed
from .tape import write_tape

RECEIVE_S = 0.005  # another thread may read it first


class ProcessBoard(ABC):
    """A running board; ``path`` is a pty that any serial program can open."""

    def __init__(
        self, source: Source, *, pace: float, hold: bool, live: bool = False, flash: Path | None = None
    ) -> None:
        """Start it: it plays ``source``; ``live``: those are only the first rounds, and ``sensors`` is fed.

        ``flash`` is the file with the board's settings and maps, where the command has one. Raises PortError when it
        does not start.
        """
        self.source = source
        self.pace = pace
        self.live = live
        self.sensors: SensorFeed | None = None
        self.over = False  # the tape has been played, and all output handed over
        self._received = b""
        self._answers: list[str] = []
        self._receiving = threading.Lock()
        self._folder = tempfile.TemporaryDirectory(prefix="biotac-sim-")
        options = ["--pace", str(pace)]
        if live:
            options += ["--live", str(source.samples.shape[1])]
        else:
            write_tape(Path(self._folder.name) / "counts.tape", source)
            options += ["--tape", str(Path(self._folder.name) / "counts.tape")]
        options += ["--serials", ",".join(source.serials)] if source.serials else []
        options += ["--flash", str(flash)] if flash is not None else []
        options += ["--hold"] if hold else []
        try:
            self._process = self._start(options)
        except BaseException:
            self._folder.cleanup()
            raise
        try:
            if live:
                self.sensors = SensorFeed(_Loopback(self._announced("control")))
                self.sensors.listen()
                self.sensors.put(source.samples)  # an emulated board samples as it boots
            self.path = self._announced("pty")
        except BaseException:
            self.close()
            raise
        #: Of the board's stdout: readable when it has a line, or is gone.
        self.stdout_fd: int = self._process.stdout.fileno()
        # The board has read the tape by now. The folder goes here, so that nothing remains however this process ends.
        self._folder.cleanup()

    def _announced(self, kind: str) -> str:
        """The port in the next line of stdout, which names this."""
        words = self._process.stdout.readline().decode().split()
        if len(words) != 2 or words[0] != kind:
            raise PortError(f"the board did not start: {self._last_lines() or 'no message'}")
        return words[1] if kind == "pty" else f"socket://127.0.0.1:{words[1]}"

    @abstractmethod
    def _start(self, options: list[str]) -> Any:
        """The board's process, with three pipes."""

    def link(self, port: str) -> ProcessLink:
        """This board for a Hand, which closes it."""
        return (LiveLink if self.live else ProcessLink)(port, self)

    def receive(self, timeout_s: float | None) -> None:
        """Wait for output of the board and read it. Raises DeviceLostError when the board has died."""
        select.select([self.stdout_fd], [], [], timeout_s)
        with self._receiving:  # another thread may have read it meanwhile
            if not select.select([self.stdout_fd], [], [], 0)[0]:
                return
            text = os.read(self.stdout_fd, 65536)
            if not text:
                raise DeviceLostError(f"the simulated board died: {self._last_lines() or 'no message'}")
            *lines, self._received = (self._received + text).split(b"\n")
            for line in lines:
                if line == b"end":
                    self.over = True
                else:
                    self._answers.append(line.decode())

    def send_line(self, line: str) -> None:
        """Send a line to the board's process, separately from the link."""
        self._process.stdin.write(f"{line}\n".encode())
        self._process.stdin.flush()

    def put(self, words: npt.NDArray[np.uint16]) -> None:
        """Give the sensors the next rounds, uint16 (rounds, fingers, 44), and wait until device time stands still."""
        assert self.sensors is not None
        self.sensors.put(words)
        self.sensors.wait_still()

    def release(self) -> None:
        """Let a held board's time run."""
        self.send_line("run")

    def restart(self) -> None:
        """Reset the board, and wait until it runs again. Rounds sent to the sensors before may be lost."""
        self.receive(0)
        self._answers.clear()
        self.send_line("restart")
        while "restarted" not in self._answers:
            self.receive(RECEIVE_S)

    def close(self) -> None:
        """End the process and remove the files. Safe to call twice."""
        if self.sensors is not None:
            self.sensors.close()
        with self._process:  # which then closes the pipes and waits
            self._process.kill()
        self._folder.cleanup()  # again, for a board that did not start

    def _last_lines(self) -> str:
        self._process.stdin.close()  # a board that is still there ends
        self._process.wait(timeout=60)
        return " ".join(self._process.stderr.read().decode(errors="replace").split("\n")).strip()


class _Loopback(SerialLink):
    """The socket on which a board's sensors are fed."""

    patience = PATIENCE


class ProcessLink(SerialLink):
    """A link to a board that is a process, which the link owns and closes."""

    patience = PATIENCE
    room = 16384

    def __init__(self, port: str, board: ProcessBoard) -> None:
        self.board = board
        self._held = True
        try:
            super().__init__(board.path)
        except BaseException:
            board.close()
            raise
        self.port = port
        self.source = board.source
        self.pace = board.pace
        self.keeps_time = board.pace == 1.0

    def ports(self) -> list[str]:
        """The same port: it stays while the board is unplugged or without power."""
        return [self.board.path]

    def reopen(self, port: str) -> None:
        super().reopen(port)
        self.fd = None  # the process must be polled as well

    def _receive(self, timeout_s: float) -> bytes:
        """Wait for bytes, or for the end of the source."""
        watched = [self._port.fileno()] + ([] if self.board.over else [self.board.stdout_fd])
        ready, _, _ = select.select(watched, [], [], timeout_s)
        if len(watched) > 1 and watched[1] in ready:
            self.board.receive(0)
        self.ended = self.board.over
        return super()._receive(0.0) if watched[0] in ready else b""

    def release(self) -> None:
        if self._held:
            self._held = False
            self.board.release()

    def close(self) -> None:
        super().close()
        self.board.close()


class LiveLink(ProcessLink):
    """The link to a live board, another process: it counts bytes, to know when all were passed on to the hand."""

    lock_step = True

    def __init__(self, port: str, board: ProcessBoard) -> None:
        self._passed_on = threading.Condition()
        self._read_bytes = self._passed_bytes = self._before_bytes = 0
        super().__init__(port, board)

    def read(self, timeout_s: float) -> bytes:
        with self._passed_on:
            self._passed_bytes = self._read_bytes  # a reader that reads on has passed on the bytes before
            self._passed_on.notify_all()
        chunk = super().read(timeout_s)
        self._read_bytes += len(chunk)
        return chunk

    def count_from(self, status: EmuStatus) -> None:
        """All bytes of the board up to ``status`` have been read, and are on their way to the hand."""
        self._before_bytes = status.link_bytes - self._read_bytes

    def wait_passed_on(self, status: EmuStatus, timeout_s: float) -> bool:
        """Wait until the hand has all bytes of the board up to ``status``; false when that needs too long."""
        most = (status.link_bytes - self._before_bytes) % 2**32
        with self._passed_on:
            return self._passed_on.wait_for(lambda: (self._passed_bytes - most) % 2**32 < 2**31, timeout_s)


class CommandBoard(ProcessBoard):
    """The board that the command in the environment variable BIOTAC_SIM runs, as tools/qemu_gateway does."""

    def _start(self, options: list[str]) -> Any:
        command = shlex.split(os.environ.get("BIOTAC_SIM", ""))
        if not command or shutil.which(command[0]) is None:
            seen = " ".join(command) or "empty"
            raise PortError(f"BIOTAC_SIM is {seen}, expected the command of a board (firmware/port/README.md)")
        pipe = subprocess.PIPE
        # A signal to a terminal's processes is not meant for the board, which ends with stdin.
        return subprocess.Popen([*command, *options], stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True)
