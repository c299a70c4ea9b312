"""A board on a serial port, through pyserial."""

from __future__ import annotations

import errno
import os
import select
from contextlib import suppress
from typing import Any

import serial
from serial.tools.list_ports import comports

from ..errors import DeviceLostError, PortBusyError, PortError
from .base import Link
from .holders import holders, holders_text
from .port_text import options_of

READ_BYTES = 65536
USB_BITS_PER_S = 115200  # any value will do
TTY_BYTES = 4000  # nearly the most that one tty read gives
UART_FORM = "uart:DEVICE?baud=N"
READ_STEP_BYTES = 8192  # more would be allocated for nothing, thousands of times a second


class SerialLink(Link):
    """A byte pipe over a serial port: a UART with its bit rate, or USB, where the bit rate means nothing."""

    can_wait = os.name == "posix"  #: ``wait`` works; otherwise a read has to block on the first byte

    def __init__(self, path: str, bits_per_s: int | None = None) -> None:
        self.port = path
        self.bits_per_s = bits_per_s
        self._path = path
        self._serial: Any = None
        self._poll: Any = None
        self.reopen(path)
        real = os.path.realpath(path)  # its USB device, if it is one
        self._usb_serial = next((p.serial_number for p in comports() if os.path.realpath(p.device) == real), None)

    def spoilt(self) -> str:
        if self.fd is None or not _is_cooked(self.fd):
            return ""
        return f"another program changed the settings of {self.port}, as `stty` does; end it and open the port again"

    def ports(self) -> list[str]:
        """The same path, and wherever a USB device with the same serial number is now. Other ports are left alone."""
        moved = [p.device for p in comports() if self._usb_serial and p.serial_number == self._usb_serial]
        return [self._path, *(path for path in moved if path != self._path)]

    def reopen(self, port: str) -> None:
        SerialLink.close(self)  # the port alone, not what a subclass closes with it
        try:
            rate = self.bits_per_s or USB_BITS_PER_S
            exclusive = True if os.name == "posix" else None  # on Windows access always is
            self._serial = serial.Serial(port, rate, timeout=0, write_timeout=2, exclusive=exclusive)
        except (serial.SerialException, OSError, ValueError) as error:
            raise open_error(port, error) from error
        if os.name == "posix":
            self.fd = self._serial.fileno()
            _wait_for_a_byte(self.fd)
            self._poll = select.poll()  # serves all waits; select() would build and take apart three lists for each
            self._poll.register(self.fd, select.POLLIN)

    def read(self, timeout_s: float) -> bytes:
        try:
            if not self.can_wait:
                return self._read_blocking(timeout_s)
            return self._drain() if self.wait(timeout_s) else b""
        except (serial.SerialException, OSError) as error:
            raise disconnected(self.port, error) from error

    def wait(self, timeout_s: float) -> bool:
        """Wait until something can be read; false when nothing can within timeout_s. Not on Windows."""
        return bool(self._poll.poll(1000 * timeout_s))

    def _drain(self) -> bytes:
        # Read the descriptor itself: pyserial's read() and in_waiting would cost as much as all the decoding.
        # One tty read gives 4 KiB at most, and a reader that takes only one per wake-up loses data at high rates.
        fd, pieces = self._serial.fileno(), list[bytes]()
        with suppress(BlockingIOError):  # that was all, or another program took it
            while not pieces or (len(pieces[-1]) >= TTY_BYTES and len(pieces) < READ_BYTES // TTY_BYTES):
                pieces.append(os.read(fd, READ_STEP_BYTES))
        if pieces[:1] == [b""]:
            raise OSError("it hung up")
        return b"".join(pieces)

    def _read_blocking(self, timeout_s: float) -> bytes:
        # On Windows select() cannot wait for serial handles: block on the first byte instead.
        self._serial.timeout = timeout_s
        first = bytes(self._serial.read(1))
        self._serial.timeout = 0
        return first + bytes(self._serial.read(READ_BYTES))

    def write(self, data: bytes) -> None:
        try:
            self._serial.write(data)
        except (serial.SerialException, OSError) as error:
            raise disconnected(self.port, error) from error

    def close(self) -> None:
        if self._serial is not None:
            self._serial.close()


def _wait_for_a_byte(fd: int) -> None:
    """Let a read without data wait, as cfmakeraw does: pyserial's setting, no wait, would stay for the next program."""
    import termios

    with suppress(termios.error):  # not a tty
        settings = termios.tcgetattr(fd)
        settings[6][termios.VMIN] = 1
        termios.tcsetattr(fd, termios.TCSANOW, settings)


def _is_cooked(fd: int) -> bool:
    """Whether the terminal takes lines and control characters, which our frames are not."""
    import termios

    try:
        return bool(termios.tcgetattr(fd)[3] & termios.ICANON)
    except termios.error:  # it is gone
        return False


def open_uart(port: str) -> SerialLink:
    """Open a ``uart:`` port, an adapter on a board's UART. Raises PortError."""
    path, options = options_of(port, {"baud"}, UART_FORM)
    baud = options.get("baud", "")
    if not path or not baud.isdecimal() or int(baud) == 0:
        raise PortError(f"{port}: expected {UART_FORM}, with the board's setting uart_bits_per_s for N")
    return SerialLink(path, int(baud))


def disconnected(port: str, error: Exception) -> DeviceLostError:
    """The DeviceLostError to raise when reading an open port failed with ``error``."""
    return DeviceLostError(f"{port} went away while it was open ({error}); plug the board in and open it again")


def open_error(path: str, error: Exception) -> PortError:
    """What to raise when ``path`` could not be opened: the error in one line, with its cure."""
    code = getattr(error, "errno", None)
    text = str(error).lower()
    if code == errno.ENOENT or "no such file" in text or "filenotfound" in text:
        return PortError(f"no port {path}; `biotac list` shows the ports of this machine")
    # Windows says "access is denied" for a port that a program has open; there it means nothing else.
    if code in (errno.EBUSY, errno.EAGAIN) or "exclusively lock" in text or "access is denied" in text:
        return PortBusyError(f"{path} is in use by {holders_text(holders(path))}; close that program and try again")
    if code == errno.EACCES or "permission" in text:
        return PortError(f"no permission to open {path}; `biotac doctor` tells how to get it")
    return PortError(
        f"{path} cannot be opened as a serial port ({error}); `biotac list` shows the ports of this machine"
    )
