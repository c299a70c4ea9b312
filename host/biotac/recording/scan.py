"""Reading an MCAP file: only the wanted parts by the index, or all undamaged parts from first byte to last.

mcap's own readers end at the first damage, and do not say where; its records and chunks are read by its own code. Every
chunk has a checksum, and so have the file's records and the index. The statistics have the numbers of chunks, metadata
records and messages. A flipped bit shows in one or the other.
"""

from __future__ import annotations

import io
import os
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, BinaryIO

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, DataEnd, Footer, McapRecord, Message, Metadata, Schema, Statistics
from mcap.stream_reader import breakup_chunk, get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC

from ..errors import RecordingError, path_text
from ..link.port_text import how_to_record
from . import layout

# A second of five fingers is 0.1 MB. Files are a quarter of the size they unpack to, or less with fingers at rest. In
# memory the data needs ten times the unpacked size.
_CHUNK_MAX_BYTES = 1 << 23
_RATIO_MAX = 100
_FREE_BYTES = 1 << 24

_HEAD = struct.Struct("<BQ")  # of a record: opcode, length
_START = struct.Struct("<BQH")  # a record's head, and the channel that a message index begins with
# Of a chunk index: first and last time, where the chunk begins, its length, bytes of its channels' list, one channel.
_CHUNK_INDEX = struct.Struct("<QQQQIH")
_CHANNEL, _OF_CHANNEL = struct.Struct("<H"), 10  # of a chunk, in the index; bytes of each
_METADATA_INDEX = struct.Struct("<QQ")
_FOOTER_RECORD = struct.Struct("<BQQQI")
# As plain ints: accessing an enum member is slow, and there are sixteen thousand records.
_CHUNK, _MESSAGE_INDEX, _FOOTER = int(Opcode.CHUNK), int(Opcode.MESSAGE_INDEX), int(Opcode.FOOTER)
_FOOTER_BYTES = _HEAD.size + 16  # the part of the footer that the footer's checksum covers
_READ: dict[int, Any] = {
    Opcode.METADATA: Metadata,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.STATISTICS: Statistics,
    Opcode.DATA_END: DataEnd,
    Opcode.FOOTER: Footer,
}


Place = tuple[int, int]  # where a record begins in the file, and its length, head included


@dataclass(frozen=True)
class Index:
    """``blocks`` are the places of each block's chunks by topic, ``metadata`` those of the metadata records.

    ``records`` are the schemas and channels. ``state`` changes when the file is written again.
    """

    state: tuple[int, int]
    records: list[Schema | Channel]
    blocks: list[dict[str, Place]]
    metadata: list[Place]

    @classmethod
    def read(cls, path: Path) -> Index | None:
        """The index of a recording; None where the file has none with a right checksum, as after a kill."""
        try:
            with path.open("rb") as stream:
                state = _state_of(stream.fileno())
                tail = _FOOTER_RECORD.size + len(MCAP0_MAGIC)
                stream.seek(max(0, state[0] - tail))
                opcode, _, begin, _, crc = _FOOTER_RECORD.unpack(stream.read(_FOOTER_RECORD.size))
                if opcode != Opcode.FOOTER or stream.read() != MCAP0_MAGIC or not 0 < begin <= state[0] - tail:
                    return None
                stream.seek(begin)
                data = stream.read(state[0] - begin - len(MCAP0_MAGIC))
            return cls._parsed(state, data) if zlib.crc32(data[:-4]) == crc else None
        except (OSError, ValueError, struct.error, EOFError):
            return None

    def check(self, path: Path) -> None:
        """Raise RecordingError unless this index is the file's."""
        if not path.exists() or _state_of(path) != self.state:
            raise RecordingError(f"{path} has changed or gone since it was opened; open it again")

    @classmethod
    def _parsed(cls, state: tuple[int, int], data: bytes) -> Index | None:
        records: list[Schema | Channel] = []
        chunks: list[tuple[int, int, int]] = []
        metadata: list[Place] = []
        shared: set[int] = set()  # channels that share a chunk
        at = 0
        while at < len(data):
            opcode, length = _HEAD.unpack_from(data, at)
            at += _HEAD.size
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                records.append(_READ[opcode].read(ReadDataStream(io.BytesIO(data[at : at + length]))))
            elif opcode == Opcode.CHUNK_INDEX:
                _, _, begin, size, channels, channel = _CHUNK_INDEX.unpack_from(data, at)
                chunks += [(begin, size, channel)] if channels else []
                ids = range(at + _CHUNK_INDEX.size - 2, at + _CHUNK_INDEX.size - 2 + channels, _OF_CHANNEL)
                shared.update(_CHANNEL.unpack_from(data, k)[0] for k in (ids if len(ids) > 1 else ()))
            elif opcode == Opcode.METADATA_INDEX:
                metadata.append(_METADATA_INDEX.unpack_from(data, at))
            at += length
        topics = {record.id: record.topic for record in records if isinstance(record, Channel)}
        if not chunks or any(topics[k] in layout.ENCODINGS for k in shared):
            return None  # another program has written the file again
        blocks: list[dict[str, Place]] = [{}]
        for begin, size, channel in chunks:  # a block's head comes after the other parts
            topic = topics[channel]
            if topic in blocks[-1]:
                return None  # another program has put them in another order
            if topic in layout.ENCODINGS:
                blocks[-1][topic] = begin, size
            if topic == layout.HEAD:
                blocks.append({})
        return None if blocks[-1] else cls(state, records, blocks[:-1], metadata)


def _state_of(file: Path | int) -> tuple[int, int]:
    """Size in bytes and time of the last change in ns of a file, by path or descriptor."""
    state = os.stat(file)
    return state.st_size, state.st_mtime_ns


def _content(stream: BinaryIO, at: int, length: int) -> ReadDataStream:
    stream.seek(at)
    return ReadDataStream(io.BytesIO(stream.read(length)))


def _crc32(stream: BinaryIO, begin: int, end: int) -> int:
    """CRC-32 of the file's bytes from begin to end."""
    crc = 0
    stream.seek(begin)
    while begin < end and (data := stream.read(min(end - begin, 1 << 20))):
        crc = zlib.crc32(data, crc)
        begin += len(data)
    return crc


class Scan:
    """Iterates over Metadata, and the messages of ``wanted`` topics as (topic, Message).

    ``schemas`` holds the schemas read so far, by topic. Complete afterwards: ``problems`` in words, ``cut_off`` (the
    file ends without an index) and ``damaged_chunks``. Unwanted chunks, and the checksums of the file's records and
    index, are verified only with ``check``. With ``index``, only the metadata and the chunks of the blocks ``only`` are
    read. Raises RecordingError if the file is not an MCAP file, unpacks to far more than a recording would, or has
    changed since the index was read.
    """

    def __init__(
        self,
        path: Path,
        wanted: Callable[[str], bool],
        *,
        check: bool = True,
        index: Index | None = None,
        only: Iterable[int] = (),
    ) -> None:
        self.path = path
        self.problems: list[str] = []
        self.cut_off = False
        self.share = 0.0  #: of the file that was read so far
        self.damaged_chunks = 0
        self.schemas: dict[str, bytes] = {}
        self._wanted = cache(wanted)
        self._check = check
        self._index, self._only = index, only
        self._topics: dict[int, str] = {}
        self._unwanted: set[int] = set()  # channels
        self._schema: dict[int, bytes] = {}
        self._unpacked = 0
        self._chunks = self._metadata = 0
        self._messages: Counter[int] = Counter()  # of wanted topics, by channel
        self._counted = False
        self._data_end = 0  # where the DataEnd record ends

    def __iter__(self) -> Iterator[Metadata | tuple[str, Message]]:
        try:
            self._size = self.path.stat().st_size
            stream = self.path.open("rb", buffering=1 << 18)
        except OSError as error:
            raise RecordingError(f"{path_text(self.path)} cannot be read ({error.strerror}); check the path") from error
        with stream:
            if self._index is not None:
                yield from self._by_index(stream, self._index)
                return
            if stream.read(len(MCAP0_MAGIC)) != MCAP0_MAGIC:
                path = path_text(self.path)
                how = how_to_record(path)
                raise RecordingError(
                    f"{path} is not an MCAP file ({self._size} bytes, wrong first bytes); expected a file "
                    f"written by `biotac record`{how and '; '}{how}"
                )
            good_until = len(MCAP0_MAGIC)
            held: tuple[int, int] | None = None  # position and length of a chunk whose message indexes are being read
            channels: set[int] = set()
            while True:
                opcode, length, channel = _START.unpack(stream.read(_START.size).ljust(_START.size, b"\0"))
                at = good_until + _HEAD.size
                whole = opcode != 0 and length <= self._size - at
                if opcode == _MESSAGE_INDEX and whole:  # two out of three records
                    channels.add(channel)
                    good_until = at + length
                    stream.seek(good_until)
                    continue
                if held is not None:
                    self._chunks += 1
                    unwanted = bool(channels) and channels <= self._unwanted
                    if not unwanted or self._check:
                        yield from self._open(stream, *held, unwanted=unwanted)
                    held = None
                if opcode == _CHUNK and whole:
                    held, channels = (at, length), set()
                else:
                    record = self._read(opcode, stream, at, length) if whole else None
                    if isinstance(record, (DataEnd, Footer)):
                        self._verify_checksum(stream, record, at, length)
                    elif record is not None:
                        yield from self._process([record])
                    if not whole or opcode == _FOOTER:
                        break
                good_until = at + length
                self.share = good_until / self._size
                stream.seek(good_until)
            self.cut_off = not whole or self._size - at - length < len(MCAP0_MAGIC)
            magic = _content(stream, self._size - len(MCAP0_MAGIC), len(MCAP0_MAGIC)).read(len(MCAP0_MAGIC))
        if self.cut_off:
            lost = f"; its last {self._size - good_until} bytes cannot be read" if good_until < self._size else ""
            self.problems.append(
                f"{self.path.name} ends without its index, as after a kill or a full disk{lost}; all else was read"
            )
        elif magic != MCAP0_MAGIC or not self._counted or not self._data_end:
            self.problems.append(
                f"{self.path.name} is damaged: it lacks its statistics or end, so losses may go unnoticed"
            )

    def _by_index(self, stream: BinaryIO, index: Index) -> Iterator[Metadata | tuple[str, Message]]:
        index.check(self.path)
        for at, length in index.metadata:
            record = self._read(Opcode.METADATA, stream, at + _HEAD.size, length - _HEAD.size)
            yield from self._process([record] if record is not None else [])
        yield from self._process(index.records)
        for block in map(index.blocks.__getitem__, self._only):
            for topic, (at, length) in block.items():
                if self._wanted(topic):
                    yield from self._open(stream, at + _HEAD.size, length - _HEAD.size, unwanted=False)

    def _verify_checksum(self, stream: BinaryIO, record: DataEnd | Footer, at: int, length: int) -> None:
        """Verify the checksum in ``record``; 0 means that the program that wrote it made none."""
        if isinstance(record, DataEnd):
            self._data_end = at + length
            part, begin, end, expected = "records", 0, at - _HEAD.size, record.data_section_crc
        else:
            part, begin, expected = "index", record.summary_start, record.summary_crc
            end = at - _HEAD.size + _FOOTER_BYTES
            if begin != self._data_end:
                self.problems.append(f"{self.path.name} is damaged: its index is not where its footer says")
                return
        if self._check and expected and _crc32(stream, begin, end) != expected:
            self.problems.append(f"{self.path.name} is damaged: the checksum of its {part} is wrong")

    def _read(self, opcode: int, stream: BinaryIO, at: int, length: int) -> Any:
        """The record at ``at``; None if it is of another kind, or damaged, which is added to ``problems``."""
        try:
            if opcode == Opcode.MESSAGE:  # outside of chunks: another program has written the file again
                return Message.read(_content(stream, at, length), length)
            return _READ[opcode].read(_content(stream, at, length)) if opcode in _READ else None
        except (McapError, struct.error, ValueError, EOFError, MemoryError, OverflowError) as error:
            self.problems.append(f"a record of {self.path.name} is damaged and was skipped ({error})")
            return None

    def _process(self, records: Iterable[McapRecord]) -> Iterator[Metadata | tuple[str, Message]]:
        for record in records:
            if isinstance(record, Metadata):
                self._metadata += 1
                yield record
            elif isinstance(record, Schema):
                self._schema.setdefault(record.id, record.data)
            elif isinstance(record, Channel):
                self._topics[record.id] = record.topic
                if self._wanted(record.topic):
                    self._unwanted.discard(record.id)
                else:
                    self._unwanted.add(record.id)
                self.schemas.setdefault(record.topic, self._schema.get(record.schema_id, b""))
            elif isinstance(record, Statistics):
                self._counted = True
                seen, expected = (self._chunks, self._metadata), (record.chunk_count, record.metadata_count)
                if seen != expected:
                    self.problems.append(
                        f"{self.path.name} has {seen[0]} chunks and {seen[1]} metadata records, but its statistics say "
                        f"{expected[0]} and {expected[1]}: the file is damaged"
                    )
                self._compare(record.channel_message_counts)
            elif isinstance(record, Message) and self._wanted(topic := self._topics.get(record.channel_id, "")):
                self._messages[record.channel_id] += 1
                yield topic, record

    def _compare(self, expected: dict[int, int]) -> None:
        """Compare the numbers of messages of wanted topics, unless damaged chunks already explain a difference."""
        wanted = {channel for channel in {*expected, *self._messages} if self._wanted(self._topics.get(channel, ""))}
        if not self.damaged_chunks and any(expected.get(channel, 0) != self._messages[channel] for channel in wanted):
            self.problems.append(
                f"{self.path.name} has {sum(self._messages.values())} blocks, but its statistics say "
                f"{sum(expected.get(channel, 0) for channel in wanted)}: the file is damaged"
            )

    def _open(
        self, stream: BinaryIO, at: int, length: int, *, unwanted: bool
    ) -> Iterator[Metadata | tuple[str, Message]]:
        try:
            chunk = Chunk.read(_content(stream, at, length))
            self._check_size(chunk)
            if unwanted:
                get_chunk_data_stream(chunk, validate_crc=True)
                return
            records = breakup_chunk(chunk, validate_crc=True)
        except RecordingError:
            raise
        except Exception as error:  # mcap, zstandard and struct raise many types
            self.damaged_chunks += 1
            self.problems.append(f"one second of {self.path.name} is damaged and was skipped ({error})")
            return
        yield from self._process(records)

    def _check_size(self, chunk: Chunk) -> None:
        size = chunk.uncompressed_size
        if chunk.compression == "zstd" and len(chunk.data) >= 4:
            try:
                expected = zstandard.get_frame_parameters(chunk.data).content_size
            except zstandard.ZstdError:
                return  # unpacking it will fail too
            size = max(size, expected if expected != zstandard.CONTENTSIZE_UNKNOWN else 0)
        self._unpacked += size
        if size > _CHUNK_MAX_BYTES or self._unpacked > _FREE_BYTES + _RATIO_MAX * self._size:
            raise RecordingError(
                f"{path_text(self.path)} unpacks to {self._unpacked / 1e6:.0f} MB or more from "
                f"{self._size / 1e6:.1f} MB; expected at most {_CHUNK_MAX_BYTES >> 20} MiB per chunk and "
                f"{_RATIO_MAX} times the file's size: it is not a recording of a board"
            )
