"""Writing a recording while the board streams."""

from __future__ import annotations

import dataclasses
import errno
import json
import os
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import BinaryIO

from ..errors import InputError
from ..keep import Calibration
from ..keep.calibration_file import to_dict
from ..version import __version__
from ..wire import messages_gen as wire
from ..wire.dtypes_gen import DTYPES
from ..wire.framing import OVERHEAD_BYTES
from . import layout
from .file import RecordingFile

# Less than the second that may be lost: some of it comes between the decision and the end of the write.
FLUSH_S = 0.9
# Of a full stream. A simulated board may live faster than the host's clock: then it is bytes that close a block.
FINGER_BYTES_PER_S = 100 * sum(DTYPES[m].itemsize + OVERHEAD_BYTES for m in (wire.Frame.ID, wire.Pac.ID))
NO_MAPS: Mapping[int, bytes] = {}
NO_NAMES: Mapping[str, int] = {}


class Recorder:
    """An open recording. Made by ``Hand.record``; every chunk from the link is handed to ``write``.

    ``path`` is the file being written, ``paths`` all of them: when the board restarts its clock and numbers begin
    anew, and maybe its sensors are others, so that a further file begins.
    ``clock_s`` and ``unix_ns`` are the clocks that close a block and stamp it.
    """

    def __init__(
        self,
        path: Path,
        hello: wire.Hello,
        settings: dict[wire.Setting, int],
        calibrations: dict[int, Calibration],
        sensors: list[wire.SensorInfo],
        port: str,
        *,
        maps: Mapping[int, bytes] = NO_MAPS,
        names: Mapping[str, int] = NO_NAMES,
        overwrite: bool = False,
        mid_stream: bool = False,
        clock_s: Callable[[], float] = time.monotonic,
        unix_ns: Callable[[], int] = time.time_ns,
    ) -> None:
        self.path = path
        self.paths = [path]
        self._port = port
        self._overwrite = overwrite
        self._clock_s = clock_s
        self._unix_ns = unix_ns
        self._pending = bytearray()
        self._pending_since = 0.0
        self._arrived_ns = 0
        self._block_bytes = int(FLUSH_S * FINGER_BYTES_PER_S * max(1, hello.fingers_present.bit_count()))
        self._skip_to_delimiter = mid_stream
        self._names = names
        metadata = describe(hello, settings, calibrations, sensors, port, maps, names)
        self._file = RecordingFile(create(path, overwrite=overwrite), metadata)

    def go_on(
        self,
        hello: wire.Hello,
        settings: dict[wire.Setting, int],
        calibrations: dict[int, Calibration],
        sensors: list[wire.SensorInfo],
        maps: Mapping[int, bytes],
    ) -> None:
        """The board restarted: end this file and begin PATH.2.mcap, then PATH.3.mcap and so on.

        Raises InputError when that exists and may not be overwritten, or cannot be written; nothing is recorded then.
        """
        self.close()
        first = self.paths[0]
        path = first.with_name(f"{first.stem}.{len(self.paths) + 1}{first.suffix}")
        metadata = describe(hello, settings, calibrations, sensors, self._port, maps, self._names)
        metadata[layout.CONTINUES] = self.path.name
        self._file = RecordingFile(create(path, overwrite=self._overwrite), metadata)
        self._skip_to_delimiter = False
        self.path = path
        self.paths.append(path)

    def write(self, chunk: bytes) -> None:
        """Take bytes as they came; an empty chunk only lets a block out in time.

        Does nothing once closed: the stream may go on after its recording.
        """
        if self._file.closed:
            return
        if self._skip_to_delimiter:
            _, delimiter, chunk = chunk.partition(b"\0")
            self._skip_to_delimiter = not delimiter
        now_s = self._clock_s()
        if chunk and not self._pending:
            self._begin_block(now_s)
        self._pending += chunk
        while len(self._pending) >= self._block_bytes:
            rest = self._pending[self._block_bytes :]
            del self._pending[self._block_bytes :]
            self.flush()
            self._begin_block(now_s)
            self._pending += rest
        if self._pending and now_s - self._pending_since >= FLUSH_S:
            self.flush()

    def _begin_block(self, now_s: float) -> None:
        self._pending_since = now_s
        self._arrived_ns = self._unix_ns()

    def mark(self, what: str, facts: dict[str, str]) -> None:
        """Note that something happened here: a metadata record ``biotac.WHAT`` behind what came so far."""
        if self._file.closed:
            return
        self.flush()
        self._file.mark(what, facts)

    def flush(self) -> None:
        """Close the current block and give it to the operating system.

        Raises OSError when that fails, or when the file is in no folder any more: what it holds would be gone with it.
        """
        if os.fstat(self.fileno()).st_nlink == 0:
            self._file.close()  # told once
            raise FileNotFoundError(errno.ENOENT, "was deleted while it was recorded", str(self.path))
        self._file.add(bytes(self._pending), self._arrived_ns, self._unix_ns())
        self._pending.clear()

    @property
    def closed(self) -> bool:
        """Nothing is written any more."""
        return self._file.closed

    def fileno(self) -> int:
        """Of the file being written."""
        return self._file.fileno()

    def close(self) -> None:
        """Write what is left and the file's index. Safe to call twice."""
        if self._file.closed:
            return
        try:
            self.flush()
        finally:
            self._file.close()


def create(path: Path, *, overwrite: bool) -> BinaryIO:
    """Open ``path`` for writing. Raises InputError when it is a folder, exists, or cannot be written."""
    if path.is_dir():
        raise InputError(f"{path} is a folder; name a file in it")
    try:
        return path.open("wb" if overwrite else "xb")
    except FileExistsError as error:
        raise InputError(f"{path} exists and would be overwritten; choose another name or say --force") from error
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror}); choose another folder") from error


def describe(
    hello: wire.Hello,
    settings: dict[wire.Setting, int],
    calibrations: dict[int, Calibration],
    sensors: list[wire.SensorInfo],
    port: str,
    maps: Mapping[int, bytes] = NO_MAPS,
    names: Mapping[str, int] = NO_NAMES,
) -> dict[str, str]:
    """The metadata record: everything needed to read and judge the wire later."""
    return {
        "format": layout.FORMAT_VERSION,
        "software": __version__,
        "port": port,
        "wire": f"{wire.WIRE_MAJOR}.{wire.WIRE_MINOR}",
        "firmware": f"{hello.firmware_major}.{hello.firmware_minor}.{hello.firmware_patch}",
        "hello": json.dumps(dataclasses.asdict(hello)),
        "settings": json.dumps({s.name.lower(): value for s, value in settings.items()}),
        "calibrations": json.dumps({finger: to_dict(its) for finger, its in calibrations.items()}),
        "maps": layout.maps_text(maps),
        layout.NAMES: json.dumps(dict(names)),
        "sensors": json.dumps([dataclasses.asdict(s) for s in sensors]),
    }
