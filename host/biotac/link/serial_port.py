"""A board on a serial port, through pyserial."""

from __future__ import annotations

import errno
import os
import select
from typing import TYPE_CHECKING

import serial

from ..errors import DeviceLostError, PortError
from .holders import holders, in_words

if TYPE_CHECKING:
    from ..sim.source import Source

READ_BYTES = 65536


class SerialLink:
    """A byte pipe over USB-serial. The bit rate is meaningless on USB and left at a common one."""

    def __init__(self, path: str) -> None:
        self.port = path
        self.source: Source | None = None
        self.ended = False
        try:
            self._serial = serial.Serial(path, 115200, timeout=0, write_timeout=2, exclusive=exclusive())
        except (serial.SerialException, OSError, ValueError) as error:
            raise PortError(describe_open_error(path, error)) from error

    def read(self, timeout_s: float) -> bytes:
        """See Link.read."""
        try:
            first = self.wait(timeout_s)
            # With timeout 0 this drains: one tty read gives 4 KiB at most, and a reader that takes
            # only one per wake-up loses data at high rates.
            return first + bytes(self._serial.read(READ_BYTES))
        except (serial.SerialException, OSError) as error:
            raise DeviceLostError(
                f"{self.port} went away while it was open ({error}); plug the board in and open it again"
            ) from error

    def wait(self, timeout_s: float) -> bytes:
        """Wait until something can be read; return what the waiting itself took in."""
        if os.name == "posix":
            select.select([self._serial.fileno()], [], [], timeout_s)
            return b""
        # No select() on serial handles there: block on the first byte instead.
        self._serial.timeout = timeout_s
        first = bytes(self._serial.read(1))
        self._serial.timeout = 0
        return first

    def write(self, data: bytes) -> None:
        """See Link.write."""
        try:
            self._serial.write(data)
        except (serial.SerialException, OSError) as error:
            raise DeviceLostError(
                f"{self.port} takes no data ({error}); plug the board in and open it again"
            ) from error

    def release(self) -> None:
        """A real board's time always runs."""

    def close(self) -> None:
        """See Link.close."""
        self._serial.close()


def exclusive() -> bool | None:
    """Ask for the port alone where the platform can; Windows always does."""
    return True if os.name == "posix" else None


def describe_open_error(path: str, error: Exception) -> str:
    """One line: what was seen and the cure."""
    code = getattr(error, "errno", None)
    text = str(error).lower()
    if code == errno.ENOENT or "no such file" in text or "filenotfound" in text:
        return f"no port {path}; `biotac list` shows the ports of this machine"
    # Windows says "access is denied" of a port that somebody has open; there it has no other meaning.
    if code in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in text or "access is denied" in text:
        return f"{path} is in use by {in_words(holders(path))}; close that program and try again"
    if code == errno.EACCES or "permission" in text:
        return f"no permission to open {path}; `biotac doctor` tells how to get it"
    return f"{path} cannot be opened as a serial port ({error}); `biotac list` shows the ports of this machine"
