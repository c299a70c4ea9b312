"""A serial port that another computer shares over TCP: ``socket://HOST:PORT``, ``rfc2217://HOST:PORT`` (pyserial's)."""

from __future__ import annotations

import os
import time

import serial

from ..errors import PortError
from .serial_port import READ_BYTES, USB_BITS_PER_S, SerialLink, went_away

# rfc2217 sends every change of the timeout to its far end, so it stays fixed; a read consists of several such waits.
WAIT_S = 0.05


class UrlLink(SerialLink):
    """A byte pipe to a port that pyserial opens by URL. Several times slower than a port of this computer."""

    def reopen(self, port: str) -> None:
        self.close()
        try:
            patience = {"write_timeout": 2} if port.startswith("socket:") else {}  # rfc2217 has no write timeout
            self._serial = serial.serial_for_url(port, USB_BITS_PER_S, timeout=WAIT_S, **patience)
        except (serial.SerialException, OSError, ValueError) as error:
            raise PortError(f"{port} cannot be opened ({error}); check host and port, and that it is shared") from error
        # A socket can be read in C like any port. rfc2217 is Telnet underneath, which pyserial has to parse.
        self.fd = self._serial.fileno() if os.name == "posix" and port.startswith("socket:") else None

    def read(self, timeout_s: float) -> bytes:
        deadline_s = time.monotonic() + timeout_s
        try:
            while True:
                first = bytes(self._serial.read(1))
                if first:
                    return first + bytes(self._serial.read(min(self._serial.in_waiting, READ_BYTES)))
                if time.monotonic() >= deadline_s:
                    return b""
        except (serial.SerialException, OSError) as error:
            raise went_away(self.port, error) from error
