"""The page's source: a board, real or simulated, or a recording that answers as its board did."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from typing import Any

from ..errors import CommandRefusedError, InputError
from ..hand.hand import Hand
from ..hand.opening import shake_hands
from ..hand.record import Recorder
from ..recording.reader import Recording
from ..recording.replay.link import ReplayLink
from ..recording.replay.playback import Playback
from ..recording.rewrite import cut
from ..wire.batches import Batch, LinkStats
from ..wire.identity import board_name, version_text
from ..wire.messages_gen import BoardKind


class Player:
    """Yields the batches of ``hand``, and accepts commands from any thread; recordings go to ``folder``.

    ``board`` is the sender, as text for users. ``live``: a board, which can be tared and recorded; a recording can be
    paused.
    """

    def __init__(self, hand: Hand, folder: Path) -> None:
        self._hand = hand
        self.applied_n = hand.applied_n
        self._folder = folder
        self._replay = hand.link if isinstance(hand.link, ReplayLink) else None
        self._recorder: Recorder | None = None
        self._recording_since_us: int | None = None
        self._last_us = 0
        self.live = self._replay is None
        self.board = f"{board_name(hand.info)}, firmware {version_text(hand.info)}"
        if self._replay is not None:
            self.board += f", recorded from {self._replay.recording.metadata['port']}"
        elif hand.info.board == BoardKind.POSIX_SIM:
            self.board += "; a simulated board loses frames when this computer is busy"
        try:
            hand.stream("results", "events")
        except BaseException:
            hand.close()
            raise

    @property
    def paused(self) -> bool:
        """True from ``pause`` to ``resume``."""
        return self._replay is not None and self._replay.pacer.paused

    def batches(self) -> Iterator[Batch]:
        """Yield batches as they come; return at the end of a recording."""
        for batch in self._hand.batches():
            self._last_us = batch.last_t_us() or self._last_us
            yield batch

    def stats(self) -> LinkStats:
        return self._hand.stats

    def recording(self) -> dict[str, Any] | None:
        """``path`` and ``seconds``, device time, of the recording being written now, if any."""
        if self._recorder is None or self._recorder.closed or self._recording_since_us is None:
            return None
        return {"path": str(self._recorder.path), "seconds": (self._last_us - self._recording_since_us) / 1e6}

    def position(self) -> tuple[float | None, float]:
        """Position in a recording, in s since the first row, None for a board; and the pace."""
        if self._replay is None:
            return None, 1.0
        playback = self._replay.pacer.playback
        behind_us = (self._last_us - playback.from_us) % 2**32 if self._last_us else 0  # the wire's times wrap
        return (playback.from_us + behind_us - playback.recording.begin_us) / 1e6, self._replay.pacer.pace

    def do(self, command: str, finger: int | None, value: float | str | None = None) -> str:
        """Carry out a command of ``COMMANDS``; return the result, in words.

        Raises InputError for a command that this player does not support, any BiotacError for one that failed.
        """
        if command == "mark":
            return self._mark(str(value or "mark"), finger)
        if self._replay is not None:
            return self._command_replay(self._replay, command, value)
        if command == "tare":
            return self._tare(self._hand.fingers if finger is None else [finger])
        if command == "record":
            return self._record()
        if command == "stop":
            return self._stop()
        raise InputError(f"a board cannot {command}; it runs until it is unplugged")

    def _mark(self, text: str, finger: int | None) -> str:
        at_s, _ = self.position()
        if self._replay is not None:
            self._replay.recording.mark(text, at_s, finger=finger)
        elif self._recorder is None or self._recorder.closed:
            raise InputError("nothing is being recorded; start a recording first")
        else:
            self._hand.mark(text, finger)
        return f"marked {text!r}" + (f" at {at_s:.2f} s" if at_s is not None else "")

    def _command_replay(self, replay: ReplayLink, command: str, value: float | str | None) -> str:
        if command == "pace" and isinstance(value, float) and 0.01 <= value <= 100:
            replay.pacer.pace = value
            return f"playing at {value:g} times its pace"
        if command == "save" and isinstance(value, float):
            stop_s = self.position()[0] or 0.0
            path = self._folder / f"{replay.recording.path.stem}-{stop_s:.2f}s.mcap"
            begin_s, end_s = cut(replay.recording, path, max(0.0, stop_s - value), stop_s + 0.01)
            return f"{begin_s:.1f} to {end_s:.1f} s saved to {path}"
        if command not in ("pause", "resume"):
            done = {"tare": "tared", "record": "recorded again", "stop": "stopped"}.get(command, command)
            raise InputError(f"a recording cannot be {done}; open a board for that")
        replay.pacer.paused = command == "pause"
        return "paused" if replay.pacer.paused else "playing"

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
        """Close the board; a recording in progress is finished and kept. Safe to call twice."""
        self._hand.close()


Opener = Callable[[], Player]


class RecordingOpener:
    """Opens a recording at ``from_s``, once, then from the start, at the former pace."""

    def __init__(self, source: str, folder: Path) -> None:
        self.recording = Recording(source)
        if not self.recording.fingers:
            raise InputError(f"{source} holds no frames; record it again")
        self._source, self._folder = source, folder
        self._link: ReplayLink | None = None
        self.from_s = 0.0

    def __call__(self) -> Player:
        playback = Playback(self.recording, from_s=self.from_s)
        pace = self._link.pacer.pace if self._link is not None else 1.0
        self.from_s, self._link = 0.0, ReplayLink(self._source, playback, pace=pace)
        return Player(shake_hands(self._link), self._folder)


#: Commands of the page. ``again``, from the start after the end, and ``seek``, to another time, never reach a Player.
COMMANDS = ("tare", "record", "stop", "pause", "resume", "again", "seek", "pace", "mark", "save")


def writable(folder: Path) -> Path:
    """``folder``. Raises InputError if recordings cannot be written there."""
    if not folder.is_dir() or not os.access(folder, os.W_OK):
        raise InputError(f"{folder} is not a folder that can be written to; make it, or name another with --folder")
    return folder
