"""The simulated board: the firmware as a process on a pty, playing a Source.

The board has its own time. With pace 0 it runs as fast as this side reads, and loses nothing. A held board's time
stands still until ``release``, so that frame 0 is the source's first row.
"""

from __future__ import annotations

import os
import select
import shlex
import socket
import subprocess
import tempfile
import threading
from pathlib import Path
from typing import Any

from ..errors import DeviceLostError, PortError
from ..link import Link
from ..link.serial_port import SerialLink
from ..link.url_port import UrlLink
from ..wire.native import BUILT
from .sensor_board import SensorBoard
from .source import Source
from .tape import write_tape


class SimBoard:
    """A running simulator process; ``path`` is a pty that any serial program can open."""

    def __init__(
        self, source: Source, *, pace: float, hold: bool, live: bool = False, flash: Path | None = None
    ) -> None:
        """Start it: it plays ``source``; ``live``: those are only the first rounds, and ``sensors`` is fed.

        ``flash`` is the file in which it keeps settings and maps. Raises PortError when it does not start.
        """
        self.source = source
        self.pace = pace
        self.sensors: SensorBoard | None = None
        self.over = False  # the tape has been played, and everything handed over
        self._heard = b""
        self._answers: list[str] = []
        self._hearing = threading.Lock()
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
                self.sensors = SensorBoard(_loopback(int(self._announced("control"))))
                self.sensors.listen()
                self.sensors.put(source.samples)  # an emulated board samples as it boots
            self.path = self._announced("pty")
        except BaseException:
            self.close()
            raise
        #: Of the board's stdout: readable when it has something to say, or is gone.
        self.stdout_fd: int = self._process.stdout.fileno()
        # The board has read its tape by now. Removed here, so that nothing is left behind however this process ends.
        self._folder.cleanup()

    def _announced(self, what: str) -> str:
        """The value of the next line of its stdout, which says where ``what`` is."""
        words = self._process.stdout.readline().decode().split()
        if len(words) != 2 or words[0] != what:
            raise PortError(f"the simulator did not start: {self._last_lines() or 'no message'}")
        return str(words[1])

    def _start(self, options: list[str]) -> Any:
        """The board's process, with three pipes; the environment variable BIOTAC_SIM is the command of another one."""
        if os.name != "posix":
            raise PortError("the simulated board needs a pty, which Windows has not; run it in WSL")
        command = shlex.split(os.environ.get("BIOTAC_SIM", "")) or [str(BUILT / "bin" / "biotac-sim")]
        if not Path(command[0]).is_file():
            raise PortError(
                f"no simulator at {command[0]}; reinstall the package (pip install .), or correct BIOTAC_SIM if set"
            )
        pipe = subprocess.PIPE
        # A signal to a terminal's processes is not meant for the board, which ends with its stdin.
        return subprocess.Popen([*command, *options], stdin=pipe, stdout=pipe, stderr=pipe, start_new_session=True)

    def hear(self, timeout_s: float | None) -> None:
        """Wait for output of the board and read it. Raises DeviceLostError when the board has died."""
        select.select([self.stdout_fd], [], [], timeout_s)
        with self._hearing:  # another thread may have read it meanwhile
            if not select.select([self.stdout_fd], [], [], 0)[0]:
                return
            text = os.read(self.stdout_fd, 65536)
            if not text:
                raise DeviceLostError(f"the simulated board died: {self._last_lines() or 'no message'}")
            *lines, self._heard = (self._heard + text).split(b"\n")
            for line in lines:
                if line == b"end":
                    self.over = True
                else:
                    self._answers.append(line.decode())

    def say(self, line: str) -> None:
        """Send a line to the board's process, separately from the link."""
        self._process.stdin.write(f"{line}\n".encode())
        self._process.stdin.flush()

    def release(self) -> None:
        """Let a held board's time run."""
        self.say("run")

    def close(self) -> None:
        """End the process and remove its files. Safe to call twice."""
        if self.sensors is not None:
            self.sensors.close()
        with self._process:  # which then closes its pipes and waits
            self._process.kill()
        self._folder.cleanup()  # again, for a board that did not start

    def _last_lines(self) -> str:
        self._process.stdin.close()  # a board that is still there ends
        self._process.wait(timeout=60)
        return " ".join(self._process.stderr.read().decode(errors="replace").split("\n")).strip()


def _loopback(port: int) -> Link:
    """The socket on which a board's sensors are fed."""
    link = UrlLink(f"socket://127.0.0.1:{port}")
    with socket.socket(fileno=os.dup(link.fd or 0)) as same:
        same.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    link.patience = SimLink.patience
    return link


class SimLink(SerialLink):
    """A SerialLink to a simulated board, which it owns and closes."""

    patience = 60.0

    def __init__(self, port: str, board: SimBoard) -> None:
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
        """The same pty: it stays while its board is unplugged or without power."""
        return [self.board.path]

    def reopen(self, port: str) -> None:
        super().reopen(port)
        self.fd = None  # the process must be watched as well

    def wait(self, timeout_s: float) -> bool:
        """Wait for bytes, or for the end of the source; return True if there are bytes to read."""
        watched = [self._serial.fileno()] + ([] if self.board.over else [self.board.stdout_fd])
        ready, _, _ = select.select(watched, [], [], timeout_s)
        if len(watched) > 1 and watched[1] in ready:
            self.board.hear(0)
        self.ended = self.board.over
        return self._serial.fileno() in ready

    def release(self) -> None:
        if self._held:
            self._held = False
            self.board.release()

    def close(self) -> None:
        super().close()
        self.board.close()
