"""An MCAP file from its first byte to its last: what of it is whole, and only the chunks that are wanted.

Every chunk has a checksum, and the file's own statistics say how many there were: a flipped bit shows in one or the
other.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata, Schema, Statistics
from mcap.stream_reader import breakup_chunk, get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC

from ..errors import RecordingError

# A second of five fingers is 0.1 MB and compresses to a fifth, one of fingers at rest to a fiftieth.
_CHUNK_MAX_BYTES = 1 << 26
_RATIO_MAX = 1000
_FREE_BYTES = 1 << 26

_HEAD = struct.Struct("<BQ")
_CHANNEL = struct.Struct("<H")
_READ: dict[int, Any] = {
    Opcode.METADATA: Metadata,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.STATISTICS: Statistics,
}


def _content(stream: BinaryIO, at: int, length: int) -> ReadDataStream:
    stream.seek(at)
    return ReadDataStream(io.BytesIO(stream.read(length)))


class Scan:
    """Iterating gives Metadata, and the messages of ``wanted`` topics as (topic, Message).

    ``schemas`` by topic, as far as it has come. Afterwards ``problems`` in words, ``cut_off`` (the file ends without
    its index) and ``damaged_chunks``. Chunks that nobody wants are checked only with ``check``. RecordingError for what
    is no MCAP file, or unpacks to far more than recordings do.
    """

    def __init__(self, path: Path, wanted: Callable[[str], bool], *, check: bool = True) -> None:
        self.path = path
        self.problems: list[str] = []
        self.cut_off = False
        self.damaged_chunks = 0
        self.schemas: dict[str, bytes] = {}
        self._wanted = wanted
        self._check = check
        self._topics: dict[int, str] = {}
        self._schema: dict[int, bytes] = {}
        self._unpacked = 0
        self._chunks = self._metadata = 0
        self._counted = False

    def __iter__(self) -> Iterator[Metadata | tuple[str, Message]]:
        try:
            self._size = self.path.stat().st_size
            stream = self.path.open("rb")
        except OSError as error:
            raise RecordingError(f"{self.path} cannot be read ({error.strerror}); check the path") from error
        with stream:
            if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                raise RecordingError(
                    f"{self.path} is no MCAP file ({self._size} bytes, wrong first bytes); expected a file that "
                    "`biotac record` wrote"
                )
            good_until = stream.tell()
            held: tuple[int, int] | None = None  # where a chunk is, until its indexes say which channels it has
            channels: set[int] = set()
            while True:
                opcode, length = _HEAD.unpack(stream.read(_HEAD.size).ljust(_HEAD.size, b"\0"))
                at = stream.tell()
                whole = opcode != 0 and length <= self._size - at
                if opcode == Opcode.MESSAGE_INDEX and whole:
                    channels |= {_CHANNEL.unpack(stream.read(_CHANNEL.size).ljust(_CHANNEL.size, b"\0"))[0]}
                elif held is not None:
                    yield from self._open(stream, *held, channels)
                    held = None
                if not whole or opcode == Opcode.FOOTER:
                    break
                if opcode == Opcode.CHUNK:
                    held, channels = (at, length), set()
                elif opcode in _READ:
                    yield from self._one(opcode, _content(stream, at, length))
                good_until = at + length
                stream.seek(good_until)
            self.cut_off = not whole or self._size - at - length < len(MCAP0_MAGIC)
        if self.cut_off:
            self.problems.append(
                f"{self.path.name} ends without its index, as after a kill or a full disk: its last "
                f"{self._size - good_until} bytes are missing or unreadable, what came before them is read"
            )
        elif not self._counted:
            self.problems.append(f"{self.path.name} is damaged: without its statistics nobody knows what is missing")

    def _one(self, opcode: int, content: ReadDataStream) -> Iterator[Metadata | tuple[str, Message]]:
        try:
            record = _READ[opcode].read(content)
        except (McapError, struct.error, ValueError, EOFError, MemoryError, OverflowError) as error:
            self.problems.append(f"a record of {self.path.name} is damaged and left out ({error})")
            return
        if isinstance(record, Metadata):
            self._metadata += 1
            yield record
        else:
            yield from self._take([record])

    def _take(self, records: list[McapRecord]) -> Iterator[tuple[str, Message]]:
        for record in records:
            if isinstance(record, Schema):
                self._schema.setdefault(record.id, record.data)
            elif isinstance(record, Channel):
                self._topics[record.id] = record.topic
                self.schemas.setdefault(record.topic, self._schema.get(record.schema_id, b""))
            elif isinstance(record, Statistics):
                self._counted = True
                seen, told = (self._chunks, self._metadata), (record.chunk_count, record.metadata_count)
                if seen != told:
                    self.problems.append(
                        f"{self.path.name} has {seen[0]} chunks and {seen[1]} notes, and its statistics say {told[0]} "
                        f"and {told[1]}: some of it is damaged beyond recognition"
                    )
            elif isinstance(record, Message) and self._wanted(topic := self._topics.get(record.channel_id, "")):
                yield topic, record

    def _open(self, stream: BinaryIO, at: int, length: int, channels: set[int]) -> Iterator[tuple[str, Message]]:
        self._chunks += 1
        topics = [self._topics.get(channel) for channel in channels]
        unwanted = bool(topics) and all(topic is not None and not self._wanted(topic) for topic in topics)
        if unwanted and not self._check:
            return
        here = stream.tell()
        try:
            chunk = Chunk.read(_content(stream, at, length))
            self._weigh(chunk)
            if unwanted:
                get_chunk_data_stream(chunk, validate_crc=True)
                return
            records = breakup_chunk(chunk, validate_crc=True)
        except RecordingError:
            raise
        except Exception as error:  # mcap, zstandard and struct each raise their own kinds
            self.damaged_chunks += 1
            self.problems.append(f"one second of {self.path.name} is damaged and left out ({error})")
            return
        finally:
            stream.seek(here)
        yield from self._take(records)

    def _weigh(self, chunk: Chunk) -> None:
        size = chunk.uncompressed_size
        if chunk.compression == "zstd" and len(chunk.data) >= 4:
            try:
                told = zstandard.get_frame_parameters(chunk.data).content_size
            except zstandard.ZstdError:
                return  # it will not be opened either
            size = max(size, told if told != zstandard.CONTENTSIZE_UNKNOWN else 0)
        self._unpacked += size
        if size > _CHUNK_MAX_BYTES or self._unpacked > _FREE_BYTES + _RATIO_MAX * self._size:
            raise RecordingError(
                f"{self.path} unpacks to {self._unpacked / 1e6:.0f} MB and more, from {self._size / 1e6:.1f} MB; "
                f"expected {_CHUNK_MAX_BYTES >> 20} MB a chunk and {_RATIO_MAX} times its size at most: it is no "
                "recording of a board"
            )
