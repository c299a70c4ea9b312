"""A board, real or simulated, for the page."""

from __future__ import annotations

import os
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

from ..errors import CommandRefusedError, InputError
from ..hand.opening import open as open_hand
from ..hand.record import Recorder
from ..wire import messages_gen as wire
from ..wire.batches import Batch, LinkStats
from ..wire.identity import version_text
from .player import Player, Recorded


class LivePlayer(Player):
    """Player of a board, which is read without pauses. ``folder`` is where recordings go."""

    live = True
    paused = False

    def __init__(self, port: str, folder: Path) -> None:
        self._folder = folder
        self._recorder: Recorder | None = None
        self._recording_since_us: int | None = None
        self._last_us = 0
        # People watch, so simulated boards run in real time.
        self._hand = open_hand(port, pace=1.0)
        try:
            self._hand.stream("results", "events")
        except BaseException:
            self._hand.close()
            raise
        self.board = describe(self._hand.info)

    def batches(self) -> Iterator[Batch]:
        for batch in self._hand.batches():
            self._last_us = batch.last_t_us() or self._last_us
            yield batch

    def stats(self) -> LinkStats:
        return self._hand.stats

    def recording(self) -> Recorded | None:
        if self._recorder is None or self._recorder.closed or self._recording_since_us is None:
            return None
        return Recorded(str(self._recorder.path), (self._last_us - self._recording_since_us) / 1e6)

    def do(self, command: str, finger: int | None) -> str:
        if command == "tare":
            return self._tare(self._hand.fingers if finger is None else [finger])
        if command == "record":
            return self._record()
        if command == "stop":
            return self._stop()
        raise InputError(f"a board cannot {command}; it runs until it is unplugged")

    def _tare(self, fingers: list[int]) -> str:
        refused: list[str] = []
        for finger in fingers:
            try:
                self._hand.tare(finger)
            except CommandRefusedError as error:
                refused.append(f"finger {finger}: {error}")
        if refused:
            raise CommandRefusedError("; ".join(refused))
        names = ", ".join(str(f) for f in fingers)
        return f"tared finger{'' if len(fingers) == 1 else 's'} {names}"

    def _record(self) -> str:
        name = f"biotac-{datetime.now():%Y%m%d-%H%M%S}.mcap"
        self._recorder = self._hand.record(self._folder / name)
        self._recording_since_us = self._last_us
        return f"recording to {self._recorder.path}"

    def _stop(self) -> str:
        recorder = self._recorder
        if recorder is None or recorder.closed:
            raise InputError("nothing is being recorded; start a recording first")
        recorder.close()
        return f"recorded to {recorder.path}"

    def close(self) -> None:
        """Close the board; a recording in progress is finished and kept."""
        self._hand.close()


def describe(hello: wire.Hello) -> str:
    """Board and firmware, as text for users."""
    return f"{wire.BOARD_DOC.get(hello.board, f'board {hello.board}')}, firmware {version_text(hello)}"


def writable(folder: Path) -> Path:
    """``folder``. Raises InputError if recordings cannot be written there."""
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        raise InputError(f"{folder} is not a writable folder; name another with --folder")
    return folder
