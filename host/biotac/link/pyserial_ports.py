"""Serial ports through pyserial: of this computer, or ``rfc2217://HOST:PORT`` of another, with line settings."""

from __future__ import annotations

import os
import select
import time
from contextlib import suppress

import serial

READ_BYTES = 65536
TTY_BYTES = 4000  # nearly the most that one tty read gives
READ_STEP_BYTES = 8192  # more would be allocated for nothing, thousands of times a second
# rfc2217 sends every change of the timeout to the far end, so it stays fixed; a read consists of several such waits.
WAIT_S = 0.05
IS_POSIX = os.name == "posix"


class TtyPort(serial.Serial):  # type: ignore[misc]
    """Opens ``path`` for itself alone. Raises OSError, or ValueError for an unsupported bit rate."""

    def __init__(self, path: str, bits_per_s: int) -> None:
        exclusive = True if IS_POSIX else None  # on Windows access always is
        super().__init__(path, bits_per_s, timeout=0, write_timeout=2, exclusive=exclusive)
        #: See Link.fd.
        self.readable_fd: int | None = None
        if IS_POSIX:
            self.readable_fd = self.fileno()
            _wait_for_a_byte(self.readable_fd)
            self._poll = select.poll()  # serves all waits; select() would build and take apart three lists for each
            self._poll.register(self.readable_fd, select.POLLIN)

    def receive(self, timeout_s: float) -> bytes:
        """All bytes that have come, waiting up to timeout_s for the first. Raises OSError when the port is gone."""
        if not IS_POSIX:
            # On Windows select() cannot wait for serial handles: block on the first byte instead.
            self.timeout = timeout_s
            first = bytes(self.read(1))
            self.timeout = 0
            return first + bytes(self.read(READ_BYTES))
        if not self._poll.poll(1000 * timeout_s):
            return b""
        # Read the descriptor itself: pyserial's read() and in_waiting would cost as much as all the decoding.
        # One tty read gives 4 KiB at most, and a reader with one read per wake-up loses data at high rates.
        fd, pieces = self.fileno(), list[bytes]()
        with suppress(BlockingIOError):  # that was all, or another program took it
            while not pieces or (len(pieces[-1]) >= TTY_BYTES and len(pieces) < READ_BYTES // TTY_BYTES):
                pieces.append(os.read(fd, READ_STEP_BYTES))
        if pieces[:1] == [b""]:
            raise OSError("it hung up")
        return b"".join(pieces)


class Rfc2217Port:
    """Several times slower than a port of this computer. Raises OSError, or ValueError for a port of another form."""

    readable_fd: int | None = None  # Telnet is underneath, which pyserial has to parse

    def __init__(self, port: str, bits_per_s: int) -> None:
        self._serial = serial.serial_for_url(port, bits_per_s, timeout=WAIT_S)  # imports Telnet only here
        self.write, self.close = self._serial.write, self._serial.close

    def receive(self, timeout_s: float) -> bytes:
        """See TtyPort.receive."""
        deadline_s = time.monotonic() + timeout_s
        while True:
            first = bytes(self._serial.read(1))
            if first:
                return first + bytes(self._serial.read(min(self._serial.in_waiting, READ_BYTES)))
            if time.monotonic() >= deadline_s:
                return b""


def _wait_for_a_byte(fd: int) -> None:
    """Let a read without data wait, as cfmakeraw does: pyserial's setting, no wait, would stay for the next program."""
    import termios

    with suppress(termios.error):  # not a tty
        settings = termios.tcgetattr(fd)
        settings[6][termios.VMIN] = 1
        termios.tcsetattr(fd, termios.TCSANOW, settings)


def is_cooked(fd: int) -> bool:
    """Whether the terminal interprets lines and control characters; frames are binary."""
    import termios

    try:
        return bool(termios.tcgetattr(fd)[3] & termios.ICANON)
    except termios.error:  # it is gone, or no terminal
        return False
