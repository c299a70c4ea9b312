"""Writing a recording while the board streams."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import time
from importlib import resources
from pathlib import Path

from mcap.writer import CompressionType, Writer

from .. import _wire as wire
from ..calibration import Calibration
from ..calibration.file import to_dict
from ..errors import InputError
from ..version import __version__
from . import layout

FLUSH_S = 1.0
FLUSH_BYTES = 1 << 20


class Recorder:
    """An open recording. Made by ``Hand.record``; every chunk from the link is handed to ``write``."""

    def __init__(
        self,
        path: Path,
        hello: wire.Hello,
        settings: dict[wire.Setting, int],
        calibrations: dict[int, Calibration],
        sensors: list[wire.SensorInfo],
        port: str,
        *,
        overwrite: bool = False,
        mid_stream: bool = False,
    ) -> None:
        self.path = path
        self._pending = bytearray()
        self._pending_since = 0.0
        self._skip_to_delimiter = mid_stream
        self._sequence = 0
        if path.is_dir():
            raise InputError(f"{path} is a folder; name a file in it")
        try:
            self._file = path.open("wb" if overwrite else "xb")
        except FileExistsError as error:
            raise InputError(f"{path} exists and would be overwritten; choose another name or say --force") from error
        except OSError as error:
            raise InputError(f"{path} cannot be written ({error.strerror}); choose another folder") from error
        try:
            self._begin(describe(hello, settings, calibrations, sensors, port))
        except OSError:
            with contextlib.suppress(OSError):  # the disk is as full as it was
                self._file.close()
            raise

    def _begin(self, metadata: dict[str, str]) -> None:
        # A chunk size of one byte closes a chunk after every message, and each message is one
        # second: what is on disk is whole up to a second ago.
        self._writer = Writer(self._file, chunk_size=1, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library=f"biotac-gateway {__version__}")
        schema = resources.files("biotac").joinpath("schema.json").read_bytes()
        schema_id = self._writer.register_schema(layout.SCHEMA_NAME, layout.SCHEMA_ENCODING, schema)
        self._channel = self._writer.register_channel(layout.TOPIC, layout.MESSAGE_ENCODING, schema_id)
        self._writer.add_metadata(layout.METADATA_NAME, metadata)
        self._file.flush()

    def write(self, chunk: bytes) -> None:
        """Take bytes as they came; an empty chunk only lets a second's worth out in time.

        Does nothing once closed: the stream may go on after its recording.
        """
        if self._file.closed:
            return
        if self._skip_to_delimiter:
            _, delimiter, chunk = chunk.partition(b"\0")
            self._skip_to_delimiter = not delimiter
        now = time.monotonic()
        if chunk and not self._pending:
            self._pending_since = now
        self._pending += chunk
        if self._pending and (now - self._pending_since >= FLUSH_S or len(self._pending) >= FLUSH_BYTES):
            self.flush()

    def mark(self, what: str, facts: dict[str, str]) -> None:
        """Note that something happened here: a metadata record ``biotac.WHAT`` behind what came so far."""
        if self._file.closed:
            return
        self.flush()
        self._writer.add_metadata(f"{layout.METADATA_NAME}.{what}", facts)
        self._file.flush()

    def flush(self) -> None:
        """Close the current chunk and give it to the operating system."""
        if not self._pending:
            return
        now_ns = time.time_ns()
        self._writer.add_message(self._channel, now_ns, bytes(self._pending), now_ns, self._sequence)
        self._sequence += 1
        self._pending.clear()
        self._file.flush()

    @property
    def closed(self) -> bool:
        """Nothing is written any more."""
        return self._file.closed

    def close(self) -> None:
        """Write what is left and the file's index. Safe to call twice."""
        if self._file.closed:
            return
        try:
            self.flush()
            self._writer.finish()  # type: ignore[no-untyped-call]
        finally:
            self._file.close()  # also on a full disk, or the interpreter would try once more at its end


def describe(
    hello: wire.Hello,
    settings: dict[wire.Setting, int],
    calibrations: dict[int, Calibration],
    sensors: list[wire.SensorInfo],
    port: str,
) -> dict[str, str]:
    """The metadata record: everything needed to read and judge the wire later."""
    return {
        "format": layout.FORMAT_VERSION,
        "software": __version__,
        "port": port,
        "wire": f"{wire.WIRE_MAJOR}.{wire.WIRE_MINOR}",
        "hello": json.dumps(dataclasses.asdict(hello)),
        "settings": json.dumps({s.name.lower(): value for s, value in settings.items()}),
        "calibrations": json.dumps({finger: to_dict(its) for finger, its in calibrations.items()}),
        "sensors": json.dumps([dataclasses.asdict(s) for s in sensors]),
    }
