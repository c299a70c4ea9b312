"""The MCAP file below every recording, live, recomputed or imported.

Each second is stored as one chunk per finger, one chunk with the other messages and the order of all, which cannot be
recovered from elsewhere, and one chunk for plotting. Each chunk is closed and handed to the operating system at once.
A second that cannot be split so that it could be reassembled byte for byte (it holds damaged messages, or another
version's) is stored as it came.
"""

from __future__ import annotations

import contextlib
from importlib import resources
from typing import BinaryIO

from mcap.writer import CompressionType, IndexType, Writer

from ..version import __version__
from ..wire.batches import StreamDecoder
from . import layout
from .block import schema as schema_of_parts
from .block import take_apart
from .plots import Plots

# Large enough that only flush() closes a chunk; the library would also close it by size.
_CHUNK_BYTES = 1 << 40


class RecordingFile:
    """A recording being written to ``stream``. Closing it closes ``stream``, as does a failure to begin it."""

    def __init__(self, stream: BinaryIO, metadata: dict[str, str]) -> None:
        self._stream = stream
        self._sequence = 0
        try:
            self._begin(metadata)
        except OSError:
            with contextlib.suppress(OSError):  # the disk is still full
                stream.close()
            raise

    def _begin(self, metadata: dict[str, str]) -> None:
        self._writer = Writer(
            self._stream,
            chunk_size=_CHUNK_BYTES,
            compression=CompressionType.ZSTD,
            index_types=IndexType.ALL,
            enable_data_crcs=True,
        )
        self._writer.start(profile="", library=f"biotac-gateway {__version__}")
        self._last = (0, 0)
        self._tail = b""  # of a message whose end has not arrived yet
        self._decoder = StreamDecoder()
        self._decoder.accept_newer_minor()
        schema = resources.files("biotac").joinpath("schema.json").read_bytes()
        self._wire_schema = self._writer.register_schema(layout.SCHEMA_NAME, layout.SCHEMA_ENCODING, schema)
        self._parts_schema = self._writer.register_schema(layout.PARTS_SCHEMA, layout.PARTS_ENCODING, schema_of_parts())
        self._channels: dict[str, int] = {}
        self._plots = Plots(self._writer)
        self._metadata = layout.signed(metadata)
        self._writer.add_metadata(layout.METADATA_NAME, self._metadata)
        self._writer.flush()  # type: ignore[no-untyped-call]

    def add(self, block: bytes, arrived_ns: int, all_here_ns: int | None = None) -> None:
        """Append wire bytes; ``arrived_ns`` is when their first byte arrived, in ns on the host's clock (Unix).

        ``all_here_ns`` is when all of them had arrived; None if unknown. Bytes after the last delimiter wait for the
        next block.
        """
        data = self._tail + block
        end = data.rfind(b"\0") + 1
        data, self._tail = data[:end], data[end:]
        if not data:
            return
        batch = self._decoder.feed(data)
        apart = take_apart(data, batch)
        stamps = all_here_ns or arrived_ns, arrived_ns
        if apart is None:
            self._put(layout.TOPIC, data, stamps)
        else:
            for finger, part in sorted(apart.parts.items()):
                self._put(f"{layout.PARTS}{finger}", part, stamps)
            self._put(layout.REST, apart.rest.pack(), stamps)
        self._sequence += 1
        self._last = stamps
        if self._plots.add(batch, self._decoder, arrived_ns, all_here_ns):
            self._writer.flush()  # type: ignore[no-untyped-call]

    def _put(self, topic: str, data: bytes, stamps: tuple[int, int]) -> None:
        """Write a message as a chunk of its own, so that a reader need not open the others."""
        if topic not in self._channels:
            encoding, schema = (
                (layout.MESSAGE_ENCODING, self._wire_schema)
                if topic == layout.TOPIC
                else (layout.PARTS_ENCODING, self._parts_schema)
            )
            self._channels[topic] = self._writer.register_channel(topic, encoding, schema)
        all_here_ns, arrived_ns = stamps
        self._writer.add_message(self._channels[topic], all_here_ns, data, arrived_ns, self._sequence)
        self._writer.flush()  # type: ignore[no-untyped-call]

    def mark(self, what: str, facts: dict[str, str]) -> None:
        """Append a metadata record ``biotac.WHAT``."""
        self._writer.add_metadata(f"{layout.METADATA_NAME}.{what}", layout.signed(facts))
        self._writer.flush()  # type: ignore[no-untyped-call]

    @property
    def closed(self) -> bool:
        """True when nothing more is written."""
        return self._stream.closed

    def fileno(self) -> int:
        """File descriptor of the file."""
        return self._stream.fileno()

    def close(self) -> None:
        """Write the file's index. Safe to call twice."""
        if self._stream.closed:
            return
        try:
            if self._tail:
                self._put(layout.TOPIC, self._tail, self._last)
            self._writer.add_metadata(layout.METADATA_NAME, self._metadata)  # again, in case the first one gets damaged
            self._writer.flush()  # type: ignore[no-untyped-call]  # finish() leaves what it flushes itself out of its checksum
            self._writer.finish()  # type: ignore[no-untyped-call]
        finally:
            self._stream.close()  # also on a full disk, or the interpreter would try again at exit
