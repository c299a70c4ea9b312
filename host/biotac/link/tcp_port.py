"""A TCP connection that is read and written as a serial port is."""

from __future__ import annotations

import select
import socket
from urllib.parse import parse_qs, urlsplit

from .pyserial_ports import IS_POSIX, READ_BYTES

FORM = "socket://HOST:PORT, and ?token=T for a simulated board"
OPEN_S = 5.0
WRITE_S = 2.0


class TcpPort:
    """Connects to ``socket://HOST:PORT``. Raises OSError, or ValueError for a port of another form.

    With ``?token=T`` it says T first, as a simulated board on a loopback socket expects. ``room`` limits the bytes that
    wait for this side in the system, of an IPv4 host: an unpaced board would be far ahead of the reader.
    """

    def __init__(self, port: str, room: int | None = None) -> None:
        parts = urlsplit(port)
        token = parse_qs(parts.query).pop("token", [""])[0]
        if not parts.hostname or not parts.port or parts.query not in ("", f"token={token}"):
            raise ValueError(f"expected {FORM}")
        self._socket = _connected(parts.hostname, parts.port, room)
        self.write(token.encode())
        self.readable_fd = self.fileno() if IS_POSIX else None

    def fileno(self) -> int:
        """Of the socket. Raises OSError once it is closed."""
        fd = self._socket.fileno()
        if fd < 0:
            raise OSError("it was closed")
        return fd

    def receive(self, timeout_s: float) -> bytes:
        """See TtyPort.receive."""
        if not select.select([self.fileno()], [], [], timeout_s)[0]:
            return b""
        data = self._socket.recv(READ_BYTES)
        if not data:
            raise OSError("it hung up")
        return data

    def write(self, data: bytes) -> None:
        """Send all of data. Raises OSError when the far end accepts nothing for two seconds."""
        self._socket.sendall(data)

    def close(self) -> None:
        """Safe to call twice."""
        self._socket.close()


def _connected(host: str, port: int, room: int | None) -> socket.socket:
    if room is None:
        made = socket.create_connection((host, port), OPEN_S)
    else:
        made = socket.socket(socket.AF_INET)
        made.settimeout(OPEN_S)
        made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, room)  # later, and TCP stalls for 40 ms each time
        try:
            made.connect((host, port))
        except OSError:
            made.close()
            raise
    made.settimeout(WRITE_S)
    made.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return made
