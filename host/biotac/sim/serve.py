"""A simulated board for other programs: on a pty, or on a TCP port for a program that says a token first.

One program at a time; the next may come when it has gone, and finds the board unchanged.
"""

from __future__ import annotations

import hmac
import os
import secrets
import select
import socket
import threading
import time
from contextlib import suppress
from typing import Any

from ..errors import DeviceLostError, PortError
from .board import SimBoard

LOOK_S = 0.002  # between two looks whether somebody has opened the pty
WAIT_S = 0.2
TOKEN_S = 5.0  # for a program that has connected to say it
LOCAL = "127.0.0.1"
CHUNK_BYTES = 4096
MOST_WAITING = 16  # programs that have not said the token, or wait for their turn


def new_token() -> str:
    """128 random bits, as text."""
    return secrets.token_hex(16)


def listen(address: str = LOCAL) -> socket.socket:
    """A listening socket that no other program can take over. Raises PortError for an address that is not here."""
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    exclusive = getattr(socket, "SO_EXCLUSIVEADDRUSE", None)  # of Windows, where another could bind it, too
    if exclusive is not None:
        listening.setsockopt(socket.SOL_SOCKET, exclusive, 1)
    try:
        listening.bind((address, 0))
        listening.listen(1)
    except OSError as error:
        listening.close()
        why = error.strerror or error
        raise PortError(f"cannot listen on {address} ({why}); name an address of this computer") from error
    return listening


def says_token(program: socket.socket, token: str) -> bool:
    """Whether ``program`` says the token within TOKEN_S: nothing else of it has been read then."""
    said, until_s = b"", time.monotonic() + TOKEN_S
    with suppress(OSError):
        while len(said) < len(token) and (left_s := until_s - time.monotonic()) > 0:
            program.settimeout(left_s)
            more = program.recv(len(token) - len(said))
            if not more:
                break
            said += more
    return hmac.compare_digest(said, token.encode())


class Served:
    """Serves ``board`` at ``path`` until it is closed: a pty of this user, or with ``address`` a TCP port there.

    Without ptys on this system it is a TCP port of this computer alone. Raises PortError.
    """

    def __init__(self, board: SimBoard, *, address: str | None = None) -> None:
        self._board = board
        self._over = threading.Event()
        self._program: int | None = None  # descriptor of the connected program
        self._listening: socket.socket | None = None
        self._turn = threading.Lock()
        self._waiting = threading.BoundedSemaphore(MOST_WAITING)
        board.plug(False)
        if address is None:
            with suppress(ImportError, OSError):
                self._open_pty()
        if self._program is None:
            self._token = new_token()
            self._listening = listen(address or LOCAL)
            host, port = self._listening.getsockname()
            self.path = f"socket://{host}:{port}?token={self._token}"
        run = self._serve_pty if self._listening is None else self._serve_socket
        self._thread = threading.Thread(target=run, name=f"biotac serves {self.path}", daemon=True)
        self._thread.start()

    def _open_pty(self) -> None:
        import pty
        import tty

        master, slave = pty.openpty()
        tty.setraw(slave)  # or it would send our own frames back to us
        self.path = os.ttyname(slave)
        os.chmod(self.path, 0o600)
        os.close(slave)  # while nobody has it open, poll() says so: that is our DTR
        os.set_blocking(master, False)
        self._program = master

    @property
    def over(self) -> bool:
        """Whether the source has ended."""
        return self._board.over

    def receive(self, timeout_s: float) -> None:
        """Let so much time pass."""
        self._over.wait(timeout_s)

    def close(self) -> None:
        """Serve nobody any more. The board goes on. Safe to call twice."""
        self._over.set()
        self._board.wake()
        if self._listening is not None:
            with suppress(OSError):
                self._listening.shutdown(socket.SHUT_RDWR)
            self._listening.close()
        self._thread.join()
        if self._listening is None and self._program is not None:
            os.close(self._program)
            self._program = None

    # ---- threads -------------------------------------------------------------------------------

    def _serve_pty(self) -> None:
        assert self._program is not None
        master, poll = self._program, select.poll()
        poll.register(master, 0)
        while not self._over.is_set():
            if poll.poll(0):  # it hung up
                time.sleep(LOOK_S)
            else:
                self._pass_on(lambda size: os.read(master, size), lambda data: os.write(master, data), master)

    def _serve_socket(self) -> None:
        assert self._listening is not None
        while not self._over.is_set():
            try:
                program, _ = self._listening.accept()
            except OSError:
                return
            if self._waiting.acquire(blocking=False):
                threading.Thread(target=self._let_in, args=(program,), daemon=True).start()
            else:
                program.close()

    def _let_in(self, program: socket.socket) -> None:
        """A silent program blocks nobody; one that says the token waits in turn."""
        try:
            with program:
                if says_token(program, self._token):
                    program.setblocking(False)
                    with self._turn:
                        self._pass_on(program.recv, program.send, program.fileno())
        finally:
            self._waiting.release()

    def _pass_on(self, read: Any, write: Any, fd: int) -> None:
        """Both ways, until the program has gone."""
        self._board.plug(True)
        gone = threading.Event()
        forwards = threading.Thread(target=self._forward, args=(write, fd, gone), daemon=True)
        forwards.start()
        try:
            while not self._over.is_set() and not gone.is_set():
                if select.select([fd], [], [], WAIT_S)[0]:
                    data = read(CHUNK_BYTES)
                    if not data:
                        break
                    self._board.write(data)
        except (OSError, DeviceLostError):  # it hung up, or sends much and reads nothing
            pass
        finally:
            gone.set()
            self._board.wake()
            forwards.join()
            self._board.plug(False)

    def _forward(self, write: Any, fd: int, gone: threading.Event) -> None:
        while not gone.is_set() and not self._over.is_set():
            data = self._board.read(WAIT_S)
            while data and not gone.is_set() and not self._over.is_set():
                if select.select([], [fd], [], WAIT_S)[1]:
                    try:
                        data = data[write(data) :]
                    except BlockingIOError:
                        continue
                    except OSError:
                        gone.set()
