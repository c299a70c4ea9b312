"""Writing a recording while the board streams."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import stat
import time
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO, cast

from ..board.gap import Gap
from ..errors import InputError, exists_error, printable
from ..link.base import AppliedN
from ..link.port_text import file_of
from ..partial_file import refuse_source
from ..wire import messages_gen as wire
from ..wire.dtypes_gen import DTYPES
from . import layout
from .labels import Label
from .mcap_file import RecordingFile
from .recorded_board import RecordedBoard

# Less than the one second that may be lost: data keeps arriving between the decision to write and the end of the write.
FLUSH_S = 0.9
OWN_BYTES = 512  # the end of the metadata, which no other recording has
# Of a full stream. A simulated board may run faster than the host's clock; then the byte count closes a block.
FINGER_BYTES_PER_S = 100 * sum(2 + DTYPES[m].itemsize for m in (wire.FrameMessage.ID, wire.Pac.ID))


class Writer:
    """The files of one recording (hand/record.py). All packets from the link are passed to ``write``.

    ``path`` is the file being written; ``paths`` lists all files so far. When the board restarts, the clock and
    sequence numbers start over and the sensors may be different ones, so the recording goes on in a new file.
    ``clock_s`` decides when a block is closed; ``unix_ns`` stamps it.
    """

    def __init__(
        self,
        path: Path,
        board: RecordedBoard,
        port: str,
        *,
        overwrite: bool = False,
        applied_n: AppliedN = lambda *rows: None,
        clock_s: Callable[[], float] = time.monotonic,
        unix_ns: Callable[[], int] = lambda: max(0, time.time_ns()),  # MCAP's times begin in 1970
    ) -> None:
        self.path = path = path.absolute()  # wherever the program goes
        self.paths = [path]
        self._port = port
        self._overwrite = overwrite
        self._clock_s = clock_s
        self._unix_ns = unix_ns
        self._applied_n = applied_n
        self._pending = bytearray()
        self._damaged = Counter[str]()
        self._pending_since = 0.0
        self._arrived_ns = 0
        self._block_bytes = int(FLUSH_S * FINGER_BYTES_PER_S * max(1, board.info.fingers_present.bit_count()))
        self._frames_before = self._lost_before = 0  # in earlier files
        self._file = self._begin(path, board.metadata(port))

    def next_file(self, board: RecordedBoard) -> None:
        """Close this file and go on in a new one after a restart of the board.

        ``press.mcap`` is followed by ``press.2.mcap``, ``press.3.mcap`` and so on, without those that exist and may not
        be overwritten. Raises InputError when the new file cannot be written; nothing more is recorded then.
        """
        self.close()
        frames, lost = self.frames, self.frames_lost
        first = self.paths[0]
        number = len(self.paths) + 1
        path = first.with_name(f"{first.stem}.{number}{first.suffix}")
        while path.exists() and not self._overwrite:  # of another day
            number += 1
            path = first.with_name(f"{first.stem}.{number}{first.suffix}")
        metadata = board.metadata(self._port) | {layout.CONTINUES: printable(self.path.name)}
        self._file = self._begin(path, metadata)
        self._frames_before, self._lost_before = frames, lost
        self.path = path
        self.paths.append(path)

    def _begin(self, path: Path, metadata: dict[str, str]) -> RecordingFile:
        refuse_source(path, [file_of(self._port)])
        file = RecordingFile(create(path, overwrite=self._overwrite), metadata)
        self._at = max(0, file.stream.tell() - OWN_BYTES)
        self._own = self._on_disk(file.stream)
        return file

    def _on_disk(self, stream: BinaryIO) -> bytes:
        return os.pread(stream.fileno(), OWN_BYTES, self._at) if hasattr(os, "pread") else b""

    def write(self, packets: bytes = b"", damaged: Mapping[str, int] | None = None) -> None:
        """Record whole packets, and how many came damaged. A call with none lets a block be closed on time.

        Does nothing once closed: the stream may outlast the recording.
        """
        if self.closed:
            return
        now_s = self._clock_s()
        if (packets or damaged) and not (self._pending or self._damaged):
            self._pending_since = now_s
            self._arrived_ns = self._unix_ns()
        self._pending += packets
        if damaged:
            self._damaged.update(damaged)
        is_due = now_s - self._pending_since >= FLUSH_S or len(self._pending) >= self._block_bytes
        if is_due and (self._pending or self._damaged):
            self.flush()

    def write_gap(self, gap: Gap) -> None:
        """Record that the board was away, before the packets that come next."""
        if not self.closed:
            self.flush()
            self._file.add_gap(gap)

    def write_label(self, label: Label) -> None:
        """Record a label with the block that is being filled."""
        if not self.closed:
            self._file.add_label(label)

    @property
    def frames(self) -> int:
        """FRAMEs in the recording's files so far; after ``close``, all of them."""
        return self._frames_before + self._file.frames

    @property
    def frames_lost(self) -> int:
        """FRAMEs lost on the way to the recording's files so far, by sequence number."""
        return self._lost_before + self._file.frames_lost

    def flush(self) -> None:
        """Close the current block and hand it to the operating system.

        Raises OSError when that fails, or when the file was deleted, cut or overwritten: the block is then lost.
        """
        stream = self._file.stream
        state = os.fstat(stream.fileno())
        if state.st_nlink == 0:
            self._file.close()  # so that this is reported only once
            raise FileNotFoundError(errno.ENOENT, "was deleted during recording", str(self.path))
        cut = stat.S_ISREG(state.st_mode) and state.st_size < stream.tell()
        if cut or self._on_disk(stream) != self._own:
            stream.close()
            raise OSError(errno.EIO, "was cut or overwritten by another program during recording", str(self.path))
        self._file.add(bytes(self._pending), self._arrived_ns, self._unix_ns(), self._applied_n, self._damaged)
        self._pending.clear()
        self._damaged.clear()

    @property
    def closed(self) -> bool:
        """True when nothing more is written."""
        return self._file.stream.closed

    def close(self) -> None:
        """Write the last block and the file's index. Safe to call twice."""
        if self.closed:
            return
        try:
            self.flush()
        finally:
            self._file.close()


def _own(stream: BinaryIO, path: Path) -> None:
    """Empty the file, unless another recorder, of any process, writes it: then raises InputError."""
    with contextlib.suppress(ImportError):  # Windows has no such lock: there it is not noticed
        import fcntl

        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            stream.close()
            raise InputError(f"{path} is being recorded to; end that recording first, or choose another name") from None
        except OSError:
            pass  # a file system without locks
    if os.fstat(stream.fileno()).st_size:
        stream.truncate()


class _File(io.FileIO):
    """Names itself when it cannot be written, as on a full disk."""

    def __init__(self, fd: int, path: Path) -> None:
        super().__init__(fd, "r+")
        self._path = path

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError as error:
            error.filename = str(self._path)
            raise


def create(path: Path, *, overwrite: bool) -> BinaryIO:
    """Open ``path`` for writing. Raises InputError when it is a folder, exists, or cannot be written."""
    if path.is_dir():
        raise InputError(f"{path} is a folder; name a file in it")
    if path.suffix.lower() != ".mcap" and (path.suffix or not path.exists() or path.is_file()):
        raise InputError(
            f"{path}: a recording is an .mcap file; record to {path.name.partition('.')[0]}.mcap, "
            "then use `biotac export`"
        )
    try:
        fd = os.open(path, os.O_RDWR | os.O_CREAT | (0 if overwrite else os.O_EXCL) | getattr(os, "O_BINARY", 0), 0o666)
        file = _File(fd, path)
        if not file.seekable():
            file.close()
            raise InputError(f"{path} is a pipe or a terminal; expected a file, to which an index can be written")
        stream = cast("BinaryIO", io.BufferedRandom(file))
        _own(stream, path)
        return stream
    except FileExistsError as error:
        raise exists_error(path) from error
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}); choose another folder") from error
