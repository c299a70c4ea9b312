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
from ..sim.source import Source
from ..sim.tape import write_tape
from .serial_port import SerialLink


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
        self._folder = tempfile.TemporaryDirectory(prefix="biotac-sim-")
        tape = Path(self._folder.name) / "counts.tape"
        write_tape(tape, source)
        command = [str(executable()), "--tape", str(tape), "--pace", str(pace)]
        command += ["--serials", ",".join(source.serials)] if source.serials else []
        command += ["--hold"] if hold else []
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        assert self._process.stdout is not None
        first = self._process.stdout.readline().decode().split()
        if len(first) != 2 or first[0] != "pty":
            error = self._last_words()
            self.close()
            raise PortError(f"the simulator did not start: {error or 'it said nothing'}")
        self.path = first[1]
        # The board has mapped its tape by now; nothing is left behind however this process ends.
        self._folder.cleanup()

    def stdout_fd(self) -> int:
        """Readable when the board has something to say, or is gone."""
        assert self._process.stdout is not None
        return self._process.stdout.fileno()

    def heard_end(self) -> bool:
        """Read what the board says; true once its tape is played out."""
        text = os.read(self.stdout_fd(), 4096)
        if not text:
            raise DeviceLostError(f"the simulated board died: {self._last_words() or 'no message'}")
        return b"end" in text

    def release(self) -> None:
        """Let a held board's time run."""
        assert self._process.stdin is not None
        self._process.stdin.write(b"run\n")
        self._process.stdin.flush()

    def wait(self, timeout_s: float | None = None) -> bool:
        """Wait until the tape is over or timeout_s have passed; true when it is over."""
        ready, _, _ = select.select([self.stdout_fd()], [], [], timeout_s)
        return bool(ready) and self.heard_end()

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
        self._process.wait(timeout=5)
        return self._process.stderr.read().decode(errors="replace").strip().replace("\n", " ")


class SimLink(SerialLink):
    """A SerialLink to a simulator of its own."""

    def __init__(self, port: str, source: Source, *, pace: float) -> None:
        self.board = SimBoard(source, pace=pace, hold=True)
        self._held = True
        try:
            super().__init__(self.board.path)
        except BaseException:
            self.board.close()
            raise
        self.port = port
        self.source = source

    def wait(self, timeout_s: float) -> bytes:
        """Wait for bytes, or for word that the source is over."""
        watched = [self._serial.fileno()] + ([] if self.ended else [self.board.stdout_fd()])
        ready, _, _ = select.select(watched, [], [], timeout_s)
        if len(watched) > 1 and watched[1] in ready and self.board.heard_end():
            self.ended = True
        return b""

    def release(self) -> None:
        """See Link.release."""
        if self._held:
            self._held = False
            self.board.release()

    def close(self) -> None:
        """See Link.close."""
        super().close()
        self.board.close()
