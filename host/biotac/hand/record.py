"""Writing what a board sends to a recording, if one is open."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

from ..errors import InputError
from ..link.serial_port import nowhere
from ..wire.sensor_gen import MAX_SENSORS
from .board import Board
from .commands import Commands
from .gap import Gap


class Recorder(Protocol):
    """What Hand.record returns: the part of recording.Recorder that is needed here."""

    path: Path
    paths: list[Path]

    @property
    def closed(self) -> bool: ...
    def write(self, chunk: bytes) -> None: ...
    def write_gap(self, gap: Gap) -> None: ...
    def go_on(self, facts: Any) -> None: ...
    def close(self) -> None: ...
    def fileno(self) -> int: ...


class Recorded:
    """Begins a recording of ``board``, continues it after restarts, and ends it."""

    def __init__(self, board: Board, commands: Commands, names: Mapping[str, int]) -> None:
        self._names = names
        self._board = board
        self._commands = commands
        self._recorder: Recorder | None = None

    def record(self, path: Path, mid_stream: bool, *, overwrite: bool) -> Recorder:
        """See Hand.record."""
        if self._recorder is not None and not self._recorder.closed:
            raise InputError(f"this hand is being recorded to {self._recorder.path}; close that recorder first")
        port = self._board.link.port
        recorder: Recorder = _writer().Recorder(path, self._facts(), port, overwrite=overwrite, mid_stream=mid_stream)
        self.to(recorder)
        return recorder

    def to(self, recorder: Recorder) -> None:
        """Send everything that arrives from now on to ``recorder``."""
        self._recorder = recorder
        incoming = self._board.incoming
        incoming.record = recorder.write
        incoming.record_gap = recorder.write_gap

    def go_on(self) -> None:
        """Begin a new file after the board restarted."""
        if self._recorder is not None and not self._recorder.closed:
            try:
                self._recorder.go_on(self._facts())
            except (OSError, InputError) as error:
                incoming = self._board.incoming
                self._recorder, incoming.record, incoming.trouble = None, None, error

    def close(self) -> None:
        """Finish the recording, if there is one."""
        if self._recorder is not None:
            self._recorder.close()

    def forked(self) -> None:
        """Let go of the file in a forked child: it is the parent's, and what the child still buffers goes nowhere."""
        recorder, self._recorder = self._recorder, None
        if recorder is not None and not recorder.closed:
            nowhere(recorder.fileno())

    def _facts(self) -> Any:
        """What a recording says about the board."""
        its, hello = self._commands, self._board.info
        sensors = [its.sensor_info(finger) for finger in range(MAX_SENSORS) if hello.fingers_present >> finger & 1]
        return _writer().Facts(hello, sensors, its.settings(), its.calibrations(), its.maps(), dict(self._names))


def _writer() -> Any:
    """The module recording.writer, the only one above this folder that is used here; imported when needed."""
    return importlib.import_module("...recording.writer", __name__)
