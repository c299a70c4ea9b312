"""A serial port that another computer shares over TCP: ``socket://HOST:PORT``, ``rfc2217://HOST:PORT`` (pyserial's)."""

from __future__ import annotations

import os
import time

import serial

from ..errors import PortError
from .serial_port import READ_BYTES, USB_BITS_PER_S, SerialLink
from .tcp_port import TcpPort

# rfc2217 sends every change of the timeout to its far end, so it stays fixed; a read consists of several such waits.
WAIT_S = 0.05


class UrlLink(SerialLink):
    """A byte pipe to a port by URL. rfc2217, of pyserial, is several times slower than a port of this computer."""

    room: int | None = None  #: see TcpPort

    def __init__(self, port: str) -> None:
        super().__init__(port)
        self.port = port.partition("?token=")[0]  # the token is the business of nobody else

    def reopen(self, port: str) -> None:
        SerialLink.close(self)
        self.can_wait = port.startswith("socket:")
        try:
            if self.can_wait:
                self._serial = TcpPort(port, self.room)
            else:
                self._serial = serial.serial_for_url(port, USB_BITS_PER_S, timeout=WAIT_S)
        except (serial.SerialException, OSError, ValueError) as error:
            raise PortError(
                f"{port.partition('?')[0]} cannot be opened ({error}); check host and port, and that it is shared"
            ) from error
        # A socket can be read in C like any port. rfc2217 is Telnet underneath, which pyserial has to parse.
        self.fd = self._serial.fileno() if os.name == "posix" and self.can_wait else None

    def wait(self, timeout_s: float) -> bool:
        return bool(self._serial.wait(timeout_s))

    def _drain(self) -> bytes:
        return bytes(self._serial.read(READ_BYTES))

    def _read_blocking(self, timeout_s: float) -> bytes:
        deadline_s = time.monotonic() + timeout_s
        while True:
            first = bytes(self._serial.read(1))
            if first:
                return first + bytes(self._serial.read(min(self._serial.in_waiting, READ_BYTES)))
            if time.monotonic() >= deadline_s:
                return b""
