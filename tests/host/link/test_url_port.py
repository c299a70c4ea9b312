"""A port that another computer shares over TCP, as ser2net does; here a simulated board behind it."""

import select
import socket
import threading
from collections.abc import Iterator
from contextlib import suppress

import pytest
import serial
import serial.rfc2217
from served_board import ServedBoard

import biotac
from biotac.sim.loading import load_source

pytestmark = pytest.mark.filterwarnings("ignore:set(Daemon|Name):DeprecationWarning")  # pyserial's own


class Pty(serial.Serial):
    """A pty has no modem lines, which RFC 2217 asks for."""

    cts = dsr = ri = cd = dtr = rts = False  # type: ignore[assignment]


class Shared:
    """Bytes between one board's pty and one TCP connection at a time, plain or as RFC 2217."""

    def __init__(self, path: str, kind: str) -> None:
        self._serial = Pty(path, timeout=0)
        self._server = socket.create_server(("127.0.0.1", 0))
        self.port = f"{kind}://127.0.0.1:{self._server.getsockname()[1]}"
        self._kind = kind
        self.connection: socket.socket | None = None
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        with suppress(OSError):  # closed
            while True:
                self.connection, _ = self._server.accept()
                self._serve(self.connection)

    def write(self, data: bytes) -> None:
        """Questions that PortManager answers alone."""
        assert self.connection is not None
        self.connection.sendall(data)

    def _serve(self, connection: socket.socket) -> None:
        manager = serial.rfc2217.PortManager(self._serial, self) if self._kind == "rfc2217" else None
        try:
            while True:
                ready, _, _ = select.select([connection, self._serial], [], [])
                if connection in ready:
                    data = connection.recv(65536)
                    if not data:
                        return
                    self._serial.write(b"".join(manager.filter(data)) if manager else data)
                if self._serial in ready:
                    data = self._serial.read(65536)
                    connection.sendall(b"".join(manager.escape(data)) if manager else data)
        except OSError:
            return
        finally:
            connection.close()

    def unplug(self) -> None:
        """As when the other computer is switched off."""
        self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        if self.connection is not None:
            with suppress(OSError):
                self.connection.shutdown(socket.SHUT_RDWR)
        self._thread.join()

    def close(self) -> None:
        self._serial.close()


@pytest.fixture(params=["socket", "rfc2217"])
def shared(request: pytest.FixtureRequest) -> Iterator[Shared]:
    board = ServedBoard(load_source("press.toml", seconds=600), pace=1.0)
    shared = Shared(board.path, request.param)
    yield shared
    shared.unplug()
    shared.close()
    board.close()


def test_a_board_behind_a_network_is_a_board(shared: Shared) -> None:
    with biotac.open(shared.port) as hand:
        assert hand.port == shared.port and hand.fingers == [0]
        assert hand.status().fingers_present == 1
        pulled = hand.read(0.3)
        hand.stream()
        lived = hand.read(0.3)
        assert len(pulled) == len(lived) == 30
        assert hand.stats.frames_lost == hand.stats.crc_errors == 0


def test_a_network_that_goes_away_is_a_lost_board(shared: Shared) -> None:
    with biotac.open(shared.port) as hand:
        hand.stream()
        hand.read(0.1)
        shared.connection.shutdown(socket.SHUT_RDWR)
        with pytest.raises(biotac.DeviceLostError, match="went away while it was open"):
            while True:
                hand.read(1.0)


def test_nobody_who_listens_is_a_port_error() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = f"socket://127.0.0.1:{server.getsockname()[1]}"
    with pytest.raises(biotac.PortError, match=r"cannot be opened.*check host and port"):
        biotac.open(port)
