"""A simulated board in real time behind a proxy's pty: the proxy sees all bytes, and breaks the link in every way."""

import os
import pty
import select
import threading
import time
import tty
from collections.abc import Callable
from pathlib import Path
from typing import Any

from deframer import Deframer, encode
from served_board import ServedBoard

from biotac.sim.loading import load_source
from biotac.sim.ports import SIM, start_board
from biotac.wire import messages_gen as wire
from biotac.wire.dtypes_gen import DTYPES

ROWS = {wire.FrameMessage.ID, wire.Pac.ID, wire.Idle.ID}


class BoardBehindProxy:
    """``path`` is a symbolic link to the proxy's pty. Rows that came through are in ``passed``: (device time, finger).

    The first board's time begins with the first START, however long a program takes to open the port: a row at 5 s of
    the source comes 5 s into the stream.
    """

    def __init__(self, source: str, folder: Path, kind: str = SIM) -> None:
        self.path = folder / "ttyBOARD"
        self._source, self.kind = source, kind
        self.passed: list[tuple[int, int]] = []
        self.passed_s: dict[int, float] = {}  #: this computer's time when the frame of a board's time passed
        self.starts = 0  #: how many START commands came
        self.silent = False  #: rows do not pass; answers do
        self.unplugged = False
        self._wires: tuple[int, int] | None = None  # the proxy's side of the pty, and the board's port
        self._over = threading.Event()
        self._changing = threading.Lock()
        self._board: Any = None
        self.boot()
        self.plug()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def boot(self) -> None:
        """Start the board, or another one in the same place: the memory's content is gone."""
        before = self._board
        source = load_source(self._source, seconds=900)
        board: Any = (
            ServedBoard(source, pace=1.0, hold=True) if self.kind == SIM else start_board(self.kind, source, pace=1.0)
        )
        port = os.open(board.path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(port)
        with self._changing:
            if before is not None:
                board.release()
                os.close(self._port)
                before.close()
            self._board, self._port = board, port
            self._from_board, self._from_host = Deframer(), Deframer()

    def plug(self) -> None:
        """Make the proxy's pty, and the link to it."""
        with self._changing:
            self._near, far = pty.openpty()
            tty.setraw(far)
            os.set_blocking(self._near, False)
            self.path.unlink(missing_ok=True)
            self.path.symlink_to(os.ttyname(far))
            self._far = far
            self.unplugged = False

    def unplug(self) -> None:
        """As the kernel does: a reader of the port gets an error from now on, and the port's name is gone."""
        with self._changing:
            self.unplugged = True
            self.path.unlink()
            os.close(self._far)
            os.close(self._near)

    def stop_stream(self) -> None:
        """Another program stops the stream."""
        with self._changing:
            os.write(self._port, encode(wire.Stop.ID, wire.Stop(77).pack()))

    def _run(self) -> None:
        while not self._over.is_set():
            with self._changing:
                watched = [self._port] if self.unplugged else [self._port, self._near]
                ready, _, _ = select.select(watched, [], [], 0)
                try:
                    if self._port in ready:
                        self._pass_on(os.read(self._port, 4096))
                    if not self.unplugged and self._near in ready:
                        self._receive(os.read(self._near, 4096))
                except OSError:
                    ready = []  # it hangs up just now
            if not ready:
                time.sleep(0.001)

    def _receive(self, chunk: bytes) -> None:
        starts = sum(message_id == wire.Start.ID for message_id, _ in self._from_host.feed(chunk))
        os.write(self._port, chunk)
        if starts and not self.starts:
            assert self._board is not None
            self._board.release()
        self.starts += starts

    def _pass_on(self, chunk: bytes) -> None:
        for message_id, payload in self._from_board.feed(chunk):
            is_row = message_id in ROWS or (message_id == wire.Status.ID and payload[6] == 0)
            if self.unplugged or (self.silent and is_row):
                continue
            now_s = time.monotonic()
            try:
                data = encode(message_id, payload)
                whole = os.write(self._near, data) == len(data)
            except BlockingIOError:
                continue  # the pty is full, as a board's ring would be
            if message_id == wire.FrameMessage.ID and whole:
                t_us = int.from_bytes(payload[2:6], "little")
                self.passed_s.setdefault(t_us, now_s)
                self.passed.append((t_us, payload[DTYPES[wire.FrameMessage.ID].fields["finger"][1]]))  # type: ignore[index]

    def wait_for(self, condition: Callable[[], bool]) -> None:
        """Until ``condition`` is true; only a failing test waits for minutes."""
        end_s = time.monotonic() + 300
        while not condition():
            assert time.monotonic() < end_s
            time.sleep(0.01)

    def close(self) -> None:
        """End it."""
        self._over.set()
        self._thread.join()
        if not self.unplugged:
            self.unplug()
        os.close(self._port)
        assert self._board is not None
        self._board.close()
