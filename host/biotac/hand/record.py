"""Recording a board's stream in a separate thread: a slow disk delays nobody else."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..board.board import Board
from ..board.consumers import DeferredErrors
from ..board.gap import NEXT_ROW_US, Gap, fingers_in
from ..board.reader import Tap
from ..errors import BiotacError, DeviceLostError, InputError
from ..wire import messages_gen as wire
from ..wire.batches import Batch
from .commands import Requests
from .configuration import Configuration

if TYPE_CHECKING:  # otherwise imported where it is used: not every reader records
    from ..recording.labels import Label
    from ..recording.recorded_board import RecordedBoard

# Bytes are written this often, or once a block is full: an unpaced board waits for this too.
WRITE_S = 0.1
WRITE_BYTES = 8 << 10
# About a minute of five fingers. A slower disk loses the newest bytes, and the file says so.
LIMIT_BYTES = 8 << 20


def _of_writer(name: str, doc: str) -> Any:
    return property(lambda recorder: getattr(recorder._writer, name), doc=doc)


class _Arrived(NamedTuple):
    packets: bytes
    damaged: Mapping[str, int]


class Recorder(Tap):
    """An open recording, made by ``Hand.record``: everything that arrives, until it or the hand is closed.

    ``path`` is the file being written; ``paths`` lists all files so far: when the board restarts, a new one is begun.
    """

    path: Path = _of_writer("path", "The file being written.")
    paths: list[Path] = _of_writer("paths", "All files so far.")
    frames: int = _of_writer("frames", "How many frames the files hold; those that wait count when they are written.")
    frames_lost: int = _of_writer("frames_lost", "How many frames are missing in the files, by their sequence numbers.")
    closed: bool = _of_writer("closed", "Whether nothing more is written.")

    def __init__(self, board: Board, requests: Requests, configuration: Configuration, troubles: DeferredErrors,
                 path: Path, *, overwrite: bool) -> None:  # fmt: skip
        from ..recording.writer import Writer

        self._board = board
        self._requests = requests
        self._configuration = configuration
        self._troubles = troubles
        self._known = self._recorded_board()
        applied_n = board.reader.applied_n
        self._writer = Writer(path, self._known, board.link.port, overwrite=overwrite, applied_n=applied_n)
        self._boot_id = board.info.boot_id
        self._waiting: deque[tuple[int, _Arrived | Gap | Label]] = deque()
        self._put_bytes = self._written_bytes = 0  # each counted by one thread
        self._latest: _Arrived | None = None  # a Gap at the end of the chunk is written first
        self._dropped: Gap | None = None
        self._last_us = board.reader.last_t_us
        self._rows_us: dict[int, int] = {}  # time of the latest row, by boot id
        self._whole: list[Label] = []  # about all files
        self._spans: list[Mark] = []  # that have not ended
        self._over = False
        self._due = threading.Event()
        self._thread = board.connection.thread(self._run, "recorder")
        self._thread.start()
        self._noted: list[str] = []
        self._note()
        board.reader.add(self)

    def mark(self, text: str, finger: int | None, facts: Mapping[str, str | float], *, timed: bool = True) -> Mark:
        """See Hand.mark; without ``timed``, about the whole recording."""
        from ..recording.labels import Label

        if self.closed:
            raise InputError(f"the recording {self.path} is closed: mark it with biotac.Recording(...).mark")
        label = Label(text, self._now_us() if timed else None, None, finger, facts)
        self._whole += [] if timed else [label]
        self._append(label)
        return Mark(self, label, self._board.info.boot_id)

    def _end(self, mark: Mark) -> None:
        """Write the label again, ending now."""
        self._spans.remove(mark)
        begin_us = mark.label.t_us if mark.boot_id == self._board.info.boot_id else NEXT_ROW_US
        self._append(replace(mark.label, t_us=begin_us, end_us=max(self._now_us(), begin_us or 0)))

    def _now_us(self) -> int:
        """Time of the latest row; before the first one, also after a restart of the board, NO_TIME."""
        return self._rows_us.get(self._board.info.boot_id, NEXT_ROW_US)

    def close(self) -> None:
        """Write the remaining bytes and the file's index. Safe to call twice. Raises OSError when that fails."""
        reader = self._board.reader
        if reader.connection.is_inherited():
            return  # the file is the parent's
        reader.remove(self)
        if not self.closed:
            self._note()
        self._append_latest()
        self._end_gap()
        self._over = True
        self._due.set()
        self._thread.join()
        if not self._writer.closed:
            self._writer.close()

    def __repr__(self) -> str:
        state = "closed" if self.closed else "open"
        return f"<biotac.Recorder of {self.path}, {state}, {self.frames} frames, {self.frames_lost} lost>"

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self.close()

    # ---- on the reading thread -----------------------------------------------------------------

    def put_raw(self, chunk: bytes, batch: Batch) -> None:
        self._append_latest()
        if self._put_bytes - self._written_bytes > LIMIT_BYTES:
            if self._dropped is None:
                self._dropped = Gap("slow", None, None, time.time_ns(), 0, self._boot_id)
            return
        self._end_gap()
        if batch.packets or batch.damaged:
            self._latest = _Arrived(batch.packets, batch.damaged)

    def _end_gap(self) -> None:
        """Write a Gap for dropped bytes; the file knows which rows are around it (mcap_file.py)."""
        if self._dropped is not None:
            self._append(replace(self._dropped, back_at_ns=time.time_ns()))
            self._dropped = None

    def put(self, batch: Batch) -> None:
        last_us = self._board.reader.last_t_us
        if last_us is not None and last_us != self._last_us:
            self._last_us = self._rows_us[self._board.info.boot_id] = last_us
        for message in batch.messages:
            if isinstance(message, Gap):
                self._append(message)
        self._append_latest()

    def _append_latest(self) -> None:
        if self._latest is not None:
            self._append(self._latest)
            self._put_bytes += len(self._latest.packets)
            self._latest = None
            if self.is_full():
                self._due.set()

    def _append(self, item: _Arrived | Gap | Label) -> None:
        self._waiting.append((self._board.info.boot_id, item))

    def is_full(self) -> bool:
        return self._put_bytes - self._written_bytes > WRITE_BYTES

    # ---- on the recorder's thread --------------------------------------------------------------

    def _run(self) -> None:
        try:
            while not self._over:
                self._due.wait(WRITE_S)
                self._due.clear()
                self._write()
            self._write()
        except (OSError, BiotacError) as error:
            self._board.reader.remove(self)  # nobody is to wait for bytes that are never written
            self._troubles.add(error)
        except BaseException as error:
            self._board.connection.fail(error)

    def _write(self) -> None:
        while self._waiting:
            boot_id, item = self._waiting.popleft()
            if boot_id != self._boot_id:
                self._end_spans(self._boot_id)
                self._boot_id = boot_id
                with suppress(DeviceLostError):  # it is gone again, or closed: the former facts must do
                    self._known = self._recorded_board()
                self._writer.next_file(replace(self._known, info=self._board.info))
                for label in (*self._whole, *(mark.label for mark in self._spans)):
                    self._writer.write_label(label)
            if isinstance(item, Gap):
                self._writer.write_gap(item)
            elif isinstance(item, _Arrived):
                self._writer.write(item.packets, item.damaged)
                self._written_bytes += len(item.packets)
            else:
                self._writer.write_label(item)
        self._writer.write()  # so that a block is closed in time
        self._board.reader.notify_space()

    def _end_spans(self, boot_id: int) -> None:
        """Let open spans end with this file, and begin with the next one's first row."""
        for mark in self._spans:
            begin_us = mark.label.t_us or 0
            end_us = max(self._rows_us.get(boot_id, begin_us), begin_us)
            self._writer.write_label(replace(mark.label, end_us=end_us))
            mark.label, mark.boot_id = replace(mark.label, t_us=NEXT_ROW_US), self._board.info.boot_id

    def _recorded_board(self) -> RecordedBoard:
        """The board's description in a recording."""
        from ..recording.recorded_board import RecordedBoard

        requests, configuration, hello = self._requests, self._configuration, self._board.info
        present = fingers_in(hello.fingers_present)
        sensors = [requests.ask(wire.GetSensorInfo(0, finger), wire.SensorInfo) for finger in present]
        settings, calibrations, maps = configuration.settings(), configuration.calibrations(), configuration.maps()
        zero_ns = self._board.link.zero_ns
        return RecordedBoard(hello, sensors, settings, calibrations, maps, dict(requests.names), zero_ns)

    def _note(self) -> None:
        """Label the recording with findings about another driver's rounds since the last call."""
        for text in self._board.link.notes:
            if text not in self._noted:
                self._noted.append(text)
                self.mark(text, None, {}, timed=False)


class Mark:
    """A label that was just made. Used in a ``with`` block, it becomes a span that ends with the block."""

    def __init__(self, recorder: Recorder, label: Label, boot_id: int) -> None:
        self._recorder, self.label, self.boot_id = recorder, label, boot_id

    def __enter__(self) -> None:
        self._recorder._spans.append(self)  # it has begun already

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        self._recorder._end(self)
