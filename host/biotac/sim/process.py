"""The simulated board: the firmware as a process on a pty, playing a Source.

The board's time is its own. With pace 0 it runs as fast as this side reads and loses nothing; it
stands still until ``release``, so that frame 0 is the source's first row.
"""

from __future__ import annotations

import os
import select
import subprocess
import tempfile
from importlib import resources
from pathlib import Path

from ..errors import DeviceLostError, PortError
from ..link.serial_port import SerialLink, nowhere
from .source import Source
from .tape import write_tape


def executable() -> Path:
    """The simulator in this package; the environment variable BIOTAC_SIM names another build."""
    override = os.environ.get("BIOTAC_SIM")
    path = Path(override) if override else Path(str(resources.files("biotac"))) / "bin" / "biotac-sim"
    if not path.is_file():
        raise PortError(f"no simulator at {path}; install the package again: pip install .")
    return path


class SimBoard:
    """A running simulator process; ``path`` is the pty that any serial program can open."""

    def __init__(self, source: Source, *, pace: float, hold: bool) -> None:
        self.source = source
        self.pace = pace
        self.over = False  # the tape is played, and everything of it handed over
        self._heard = b""
        self._answers: list[str] = []
        self._folder = tempfile.TemporaryDirectory(prefix="biotac-sim-")
        tape = Path(self._folder.name) / "counts.tape"
        write_tape(tape, source)
        options = ["--tape", str(tape), "--pace", str(pace)]
        options += ["--serials", ",".join(source.serials)] if source.serials else []
        options += ["--hold"] if hold else []
        try:
            self._process = self._start(options)
        except BaseException:
            self._folder.cleanup()
            raise
        assert self._process.stdout is not None
        first = self._process.stdout.readline().decode().split()
        if len(first) != 2 or first[0] != "pty":
            error = self._last_words()
            self.close()
            raise PortError(f"the simulator did not start: {error or 'it said nothing'}")
        self.path = first[1]
        # The board has read its tape by now; nothing is left behind however this process ends.
        self._folder.cleanup()

    def _start(self, options: list[str]) -> subprocess.Popen[bytes]:
        command = [str(executable()), *options]
        return subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)

    def stdout_fd(self) -> int:
        """Readable when the board has something to say, or is gone."""
        assert self._process.stdout is not None
        return self._process.stdout.fileno()

    def hear(self) -> None:
        """Read what the board says; waits for it."""
        text = os.read(self.stdout_fd(), 65536)
        if not text:
            raise DeviceLostError(f"the simulated board died: {self._last_words() or 'no message'}")
        *lines, self._heard = (self._heard + text).split(b"\n")
        for line in lines:
            if line == b"end":
                self.over = True
            else:
                self._answers.append(line.decode())

    def say(self, line: str) -> None:
        """Tell the process that is the board, beside the link."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n".encode())
        self._process.stdin.flush()

    def release(self) -> None:
        """Let a held board's time run."""
        self.say("run")

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until the tape is over or timeout_s have passed; true when it is over."""
        ready, _, _ = select.select([self.stdout_fd()], [], [], timeout_s)
        if ready:
            self.hear()
        return self.over

    def abandon(self) -> None:
        """In a fork of the process that started it: nothing of it is ours."""
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            if pipe is not None and not pipe.closed:
                nowhere(pipe.fileno())
        self._process.returncode = 0  # its parent is to wait for it

    def close(self) -> None:
        """End the process and remove its files. Safe to call twice."""
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout, self._process.stderr):
            if pipe is not None:
                pipe.close()
        self._folder.cleanup()  # again, for a board that did not start

    def _last_words(self) -> str:
        assert self._process.stderr is not None
        self._process.wait(timeout=60)
        return self._process.stderr.read().decode(errors="replace").strip().replace("\n", " ")


class SimLink(SerialLink):
    """A SerialLink to a simulated board of its own, which it closes."""

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

    def places(self) -> list[str]:
        """The same pty: it stays while its board is unplugged or without power."""
        return [self.board.path]

    def reopen(self, place: str) -> None:
        """See Link.reopen."""
        super().reopen(place)
        self.fd = None  # the process is to be listened to as well

    def wait(self, timeout_s: float) -> bool:
        """Wait for bytes, or for word that the source is over."""
        watched = [self._serial.fileno()] + ([] if self.board.over else [self.board.stdout_fd()])
        ready, _, _ = select.select(watched, [], [], timeout_s)
        if len(watched) > 1 and watched[1] in ready:
            self.board.hear()
        self.ended = self.board.over
        return self._serial.fileno() in ready

    def abandon(self) -> None:
        """See Link.abandon."""
        super().abandon()
        self.board.abandon()

    def release(self) -> None:
        """See Link.release."""
        if self._held:
            self._held = False
            self.board.release()

    def close(self) -> None:
        """See Link.close."""
        super().close()
        self.board.close()
