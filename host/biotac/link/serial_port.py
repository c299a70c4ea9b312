"""A board on a serial port, of this computer or shared by another."""

from __future__ import annotations

import errno
import os
from typing import Any

from serial.tools.list_ports import comports

from ..errors import DeviceLostError, PortBusyError, PortError
from .base import Link
from .holders import holders, holders_text
from .port_text import options_of
from .pyserial_ports import Rfc2217Port, TtyPort, is_cooked
from .tcp_port import TcpPort

USB_BITS_PER_S = 115200  # any value will do
UART_FORM = "uart:DEVICE?baud=N"


class SerialLink(Link):
    """A byte pipe over a serial port: a UART with a bit rate, or USB, where the bit rate means nothing.

    By URL, it is one that another computer shares over TCP.
    """

    room: int | None = None  #: see TcpPort

    def __init__(self, path: str, bits_per_s: int | None = None) -> None:
        self.port = path.partition("?token=")[0]  # the token is nobody else's business
        self.bits_per_s = bits_per_s
        self._path = path
        self._port: Any = None
        self.reopen(path)
        real = os.path.realpath(path)  # the USB device, if it is one
        self._usb_serial = next((p.serial_number for p in comports() if os.path.realpath(p.device) == real), None)

    def spoilt(self) -> str:
        if self.fd is None or not is_cooked(self.fd):
            return ""
        return f"another program changed the settings of {self.port}, as `stty` does; end it and open the port again"

    def ports(self) -> list[str]:
        """The same path, and the present paths of a USB device with the same serial number. Other ports are ignored."""
        moved = [p.device for p in comports() if self._usb_serial and p.serial_number == self._usb_serial]
        return [self._path, *(path for path in moved if path != self._path)]

    def reopen(self, port: str) -> None:
        SerialLink.close(self)  # the port alone, not the parts of a subclass
        self._port = _opened(port, self.bits_per_s or USB_BITS_PER_S, self.room)
        self.fd = self._port.readable_fd

    def read(self, timeout_s: float) -> bytes:
        try:
            return self._receive(timeout_s)
        except OSError as error:
            raise disconnected(self.port, error) from error

    def _receive(self, timeout_s: float) -> bytes:
        return bytes(self._port.receive(timeout_s))

    def write(self, data: bytes) -> None:
        try:
            self._port.write(data)
        except OSError as error:
            raise disconnected(self.port, error) from error

    def close(self) -> None:
        if self._port is not None:
            self._port.close()


def _opened(port: str, bits_per_s: int, room: int | None) -> Any:
    """The TtyPort, or another of this kind. Raises PortError."""
    scheme = port.partition(":")[0]
    try:
        if scheme == "socket":
            return TcpPort(port, room)
        return (Rfc2217Port if scheme == "rfc2217" else TtyPort)(port, bits_per_s)
    except (OSError, ValueError) as error:
        if scheme not in ("socket", "rfc2217"):
            raise open_error(port, error) from error
        cure = "check host and port, and that it is shared"
        raise PortError(f"{port.partition('?')[0]} cannot be opened ({error}); {cure}") from error


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
    """The error for a ``path`` that could not be opened: one line, with the cure."""
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
