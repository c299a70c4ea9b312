"""The MCAP file below every recording, live, recomputed or imported.

A second is two chunks: the wire first, which nothing else can replace, then what is for plotting. Each
chunk is closed and handed to the operating system at once.
"""

from __future__ import annotations

import contextlib
from importlib import resources
from typing import BinaryIO

from mcap.writer import CompressionType, IndexType, Writer

from ..version import __version__
from . import layout
from .plots import Plots

# Chunks are closed by flush() alone; the library would do it by size.
_CHUNK_BYTES = 1 << 40


class RecordingFile:
    """A recording being written to ``stream``, which is closed with it and also when it cannot be begun."""

    def __init__(self, stream: BinaryIO, metadata: dict[str, str]) -> None:
        self._stream = stream
        self._sequence = 0
        try:
            self._begin(metadata)
        except OSError:
            with contextlib.suppress(OSError):  # the disk is as full as it was
                stream.close()
            raise

    def _begin(self, metadata: dict[str, str]) -> None:
        self._writer = Writer(
            self._stream, chunk_size=_CHUNK_BYTES, compression=CompressionType.ZSTD, index_types=IndexType.ALL
        )
        self._writer.start(profile="", library=f"biotac-gateway {__version__}")
        schema = resources.files("biotac").joinpath("schema.json").read_bytes()
        schema_id = self._writer.register_schema(layout.SCHEMA_NAME, layout.SCHEMA_ENCODING, schema)
        self._channel = self._writer.register_channel(layout.TOPIC, layout.MESSAGE_ENCODING, schema_id)
        self._plots = Plots(self._writer)
        self._writer.add_metadata(layout.METADATA_NAME, metadata)
        self._writer.flush()  # type: ignore[no-untyped-call]

    def add(self, block: bytes, arrived_ns: int, all_here_ns: int | None = None) -> None:
        """Append wire bytes; ``arrived_ns`` is when their first byte came, by the host's clock (Unix).

        ``all_here_ns`` is when all of them had come; None where nobody knows.
        """
        if not block:
            return
        self._writer.add_message(self._channel, all_here_ns or arrived_ns, block, arrived_ns, self._sequence)
        self._sequence += 1
        self._writer.flush()  # type: ignore[no-untyped-call]
        if self._plots.add(block, arrived_ns):
            self._writer.flush()  # type: ignore[no-untyped-call]

    def mark(self, what: str, facts: dict[str, str]) -> None:
        """Append a metadata record ``biotac.WHAT``."""
        self._writer.add_metadata(f"{layout.METADATA_NAME}.{what}", facts)
        self._writer.flush()  # type: ignore[no-untyped-call]

    @property
    def closed(self) -> bool:
        """Nothing is written any more."""
        return self._stream.closed

    def fileno(self) -> int:
        """Of the file."""
        return self._stream.fileno()

    def close(self) -> None:
        """Write the file's index. Safe to call twice."""
        if self._stream.closed:
            return
        try:
            self._writer.finish()  # type: ignore[no-untyped-call]
        finally:
            self._stream.close()  # also on a full disk, or the interpreter would try once more at its end
