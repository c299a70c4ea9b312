"""What a board says, into a recording: the one that is open, if any."""

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
from .gap import GAP


class Recorder(Protocol):
    """What Hand.record returns: a recording.Recorder, of which nothing else is needed here."""

    path: Path
    paths: list[Path]

    @property
    def closed(self) -> bool: ...
    def write(self, chunk: bytes) -> None: ...
    def mark(self, what: str, facts: dict[str, str]) -> None: ...
    def go_on(self, *board: Any) -> None: ...
    def close(self) -> None: ...
    def fileno(self) -> int: ...


class Recorded:
    """Begins a recording of ``board``, carries it over restarts, ends it."""

    def __init__(self, board: Board, commands: Commands, names: Mapping[str, int]) -> None:
        self._names = names
        self._board = board
        self._commands = commands
        self._recorder: Recorder | None = None

    def record(self, path: Path, mid_stream: bool, *, overwrite: bool) -> Recorder:
        """See Hand.record."""
        if self._recorder is not None and not self._recorder.closed:
            raise InputError(f"this hand is being recorded to {self._recorder.path}; close that recorder first")
        hello, settings, calibrations, sensors, maps = self._facts()
        # The one way up from this room.
        writer = importlib.import_module("...recording.writer", __name__)
        recorder: Recorder = writer.Recorder(
            path,
            hello,
            settings,
            calibrations,
            sensors,
            self._board.link.port,
            maps=maps,
            names=self._names,
            overwrite=overwrite,
            mid_stream=mid_stream,
        )
        self.to(recorder)
        return recorder

    def to(self, recorder: Recorder) -> None:
        """Hand it all that comes from now on."""
        self._recorder = recorder
        incoming = self._board.incoming
        incoming.record = recorder.write
        incoming.record_gap = lambda gap: recorder.mark(GAP, gap.as_text())

    def go_on(self) -> None:
        """The board restarted: its rows go into a file of their own."""
        if self._recorder is not None and not self._recorder.closed:
            try:
                self._recorder.go_on(*self._facts())
            except (OSError, InputError) as error:
                incoming = self._board.incoming
                self._recorder, incoming.record, incoming.trouble = None, None, error

    def close(self) -> None:
        """Finish the file."""
        if self._recorder is not None:
            self._recorder.close()

    def forked(self) -> None:
        """The file is the other process's: whatever this one still holds of it goes nowhere."""
        recorder, self._recorder = self._recorder, None
        if recorder is not None and not recorder.closed:
            nowhere(recorder.fileno())

    def _facts(self) -> tuple[Any, ...]:
        """HELLO, settings, calibrations, sensors and maps: what a recording's results rest on."""
        its, hello = self._commands, self._board.info
        sensors = [its.sensor_info(finger) for finger in range(MAX_SENSORS) if hello.fingers_present >> finger & 1]
        return hello, its.settings(), its.calibrations(), sensors, its.maps()
