"""A chunk of an MCAP file, and the records in it.

This replaces mcap's own reader, which finds the same records but calls a function for each field of each record: that
took a third of the time of loading a recording.
"""

from __future__ import annotations

import io
import struct
from collections.abc import Iterator

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema
from mcap.stream_reader import get_chunk_data_stream

_CHUNK = struct.Struct("<QQQII")  # first and last time, unpacked size, checksum, length of the compression's name
_LENGTH = struct.Struct("<Q")
HEAD = struct.Struct("<BQ")  # of every record: opcode, length
_MESSAGE = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_MESSAGE_OPCODE = int(Opcode.MESSAGE)  # a plain int: accessing an enum member is slow


def chunk_of(record: bytes) -> Chunk:
    """The chunk in ``record``, still compressed. Raises struct.error or UnicodeDecodeError if it is not one."""
    first, last, size, crc, named = _CHUNK.unpack_from(record)
    at = _CHUNK.size + named
    (length,) = _LENGTH.unpack_from(record, at)
    at += _LENGTH.size
    return Chunk(
        compression=record[_CHUNK.size : _CHUNK.size + named].decode(),
        data=record[at : at + length],
        message_start_time=first,
        message_end_time=last,
        uncompressed_crc=crc,
        uncompressed_size=size,
    )


def unpack(chunk: Chunk) -> bytes:
    """The chunk's data, decompressed, with its checksum verified. Raises what mcap and its decompressors raise."""
    stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    return stream.read(length)


def records_of(data: bytes) -> Iterator[Message | Channel | Schema]:
    """The records of a decompressed chunk. Raises struct.error or mcap's errors for damaged ones."""
    at = 0
    while at < len(data):
        opcode, length = HEAD.unpack_from(data, at)
        at += HEAD.size
        if opcode == _MESSAGE_OPCODE:
            channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(data, at)
            yield Message(
                channel_id=channel,
                sequence=sequence,
                log_time=log_time,
                publish_time=publish_time,
                data=data[at + _MESSAGE.size : at + length],
            )
        elif opcode in (Opcode.CHANNEL, Opcode.SCHEMA):
            kind = Channel if opcode == Opcode.CHANNEL else Schema
            yield kind.read(ReadDataStream(io.BytesIO(data[at : at + length])))
        at += length
