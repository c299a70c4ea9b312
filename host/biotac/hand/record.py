"""Recording what a board sends, in a thread of its own: a slow disk makes nobody else wait."""

from __future__ import annotations

import importlib
import threading
import time
from collections import deque
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import Any

from ..errors import BiotacError, DeviceLostError, InputError
from ..wire.batches import Batch
from ..wire.sensor_gen import MAX_SENSORS
from .board import Board
from .commands import Commands
from .consumers import Troubles
from .gap import Gap

# What waits to be written is written this often, and at once when it is over.
WRITE_S = 0.1
# About a minute of five fingers. A disk that is slower loses the newest bytes, and the file says so.
LIMIT_BYTES = 8 << 20


class Recorder:
    """An open recording, made by ``Hand.record``: everything that arrives, until it or the hand is closed.

    ``path`` is the file being written; ``paths`` lists all files so far: when the board restarts, a new one is begun.
    """

    def __init__(self, board: Board, commands: Commands, troubles: Troubles, path: Path, *, overwrite: bool,
                 mid_stream: bool) -> None:  # fmt: skip
        self._board = board
        self._commands = commands
        self._troubles = troubles
        self._known = self._facts()
        self._writer: Any = _recording().Recorder(
            path, self._known, board.link.port, overwrite=overwrite, mid_stream=mid_stream
        )
        self._boot_id = board.info.boot_id
        self._waiting: deque[tuple[int, bytes | Gap]] = deque()
        self._bytes = 0
        self._chunk = b""  # the latest: a Gap that ends with it is written first
        self._dropped: Gap | None = None
        self._over = threading.Event()
        self._thread = board.reader.thread(self._run, "recorder")
        self._thread.start()
        board.reader.add_tap(self)

    @property
    def path(self) -> Path:
        """The file being written."""
        path: Path = self._writer.path
        return path

    @property
    def paths(self) -> list[Path]:
        """All files so far."""
        paths: list[Path] = self._writer.paths
        return paths

    @property
    def frames(self) -> int:
        """How many frames the files hold; those that wait to be written count when they are."""
        frames: int = self._writer.frames
        return frames

    @property
    def frames_lost(self) -> int:
        """How many frames are missing in the files, by their sequence numbers; see ``frames``."""
        lost: int = self._writer.frames_lost
        return lost

    @property
    def closed(self) -> bool:
        """Whether nothing more is written."""
        closed: bool = self._writer.closed
        return closed

    def close(self) -> None:
        """Write what has arrived and the file's index. Safe to call twice. Raises OSError when that fails."""
        reader = self._board.reader
        if reader.is_inherited():
            return  # the file is the parent's
        reader.remove(self)
        self._append(self._chunk)
        self._chunk = b""
        self._over.set()
        self._thread.join()
        if not self._writer.closed:
            self._writer.close()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # ---- on the reading thread -----------------------------------------------------------------

    def put_raw(self, chunk: bytes) -> None:
        """See reader.Tap."""
        if self._bytes > LIMIT_BYTES:
            reader = self._board.reader
            self._dropped = self._dropped or Gap("slow", reader.last_t_us, None, time.time_ns(), 0, self._boot_id)
            return
        if self._dropped is not None:
            self._append(self._dropped)
            self._dropped = None
        self._append(self._chunk)
        self._chunk = chunk

    def put(self, batch: Batch) -> None:
        """See reader.Consumer."""
        for message in batch.messages:
            if isinstance(message, Gap):
                self._append(message)
        self._append(self._chunk)
        self._chunk = b""

    def _append(self, what: bytes | Gap) -> None:
        self._waiting.append((self._board.info.boot_id, what))
        self._bytes += len(what) if isinstance(what, bytes) else 0

    def wake(self) -> None:
        """See reader.Consumer."""

    def is_full(self) -> bool:
        """See reader.Consumer."""
        return self._bytes > LIMIT_BYTES // 2

    # ---- on its own thread ---------------------------------------------------------------------

    def _run(self) -> None:
        try:
            while not self._over.wait(WRITE_S):
                self._write()
            self._write()
        except (OSError, BiotacError) as error:
            self._board.reader.remove(self)  # nobody is to wait for what is never written
            self._troubles.keep(error)
        except BaseException as error:
            self._board.reader.fail(error)

    def _write(self) -> None:
        while self._waiting:
            boot_id, what = self._waiting.popleft()
            if boot_id != self._boot_id:
                self._boot_id = boot_id
                with suppress(DeviceLostError):  # it is gone again, or closed: what was known before has to do
                    self._known = self._facts()
                self._writer.go_on(replace(self._known, info=self._board.info))
            if isinstance(what, Gap):
                self._writer.write_gap(what)
            else:
                self._bytes -= len(what)
                self._writer.write(what)
        self._writer.write(b"")  # so that a block is closed in time
        self._board.reader.room()

    def _facts(self) -> Any:
        """What a recording says about the board."""
        commands, hello = self._commands, self._board.info
        sensors = [commands.sensor_info(f) for f in range(MAX_SENSORS) if hello.fingers_present >> f & 1]
        settings, calibrations, maps = commands.settings(), commands.calibrations(), commands.maps()
        return _recording().Facts(hello, sensors, settings, calibrations, maps, dict(commands.names))


def check_free(recorder: Recorder | None) -> None:
    """Raise InputError while ``recorder`` is open: a hand has one recording at a time."""
    if recorder is not None and not recorder.closed:
        raise InputError(f"this hand is being recorded to {recorder.path}; close that recorder first")


def _recording() -> Any:
    """The module recording.writer, the only one above this folder that is used here; imported when needed."""
    return importlib.import_module("...recording.writer", __name__)
