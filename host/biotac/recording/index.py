"""Where the parts of a complete recording lie, from the index at the file's end: a part is read without the rest."""

from __future__ import annotations

import io
import os
import struct
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Schema
from mcap.writer import MCAP0_MAGIC

from ..errors import RecordingError
from . import layout

_HEAD = struct.Struct("<BQ")  # of a record: opcode, length
_FOOTER = struct.Struct("<BQQQI")
# Of a chunk index: first and last time, where the chunk begins, its length, bytes of its channels' list, one channel.
_CHUNK_INDEX = struct.Struct("<QQQQIH")
_METADATA_INDEX = struct.Struct("<QQ")
_READ: dict[int, Any] = {Opcode.SCHEMA: Schema, Opcode.CHANNEL: Channel}

Place = tuple[int, int]  # where a record begins in the file, and its length, head included


@dataclass(frozen=True)
class Index:
    """``blocks`` are the places of each block's chunks by topic, ``metadata`` those of the metadata records.

    ``records`` are the schemas and channels. ``state`` is what changes when the file is written again.
    """

    state: tuple[int, int]
    records: list[Schema | Channel]
    blocks: list[dict[str, Place]]
    metadata: list[Place]

    @classmethod
    def read(cls, path: Path) -> Index | None:
        """The index of a recording; None where the file has none that its checksum proves, as after a kill."""
        try:
            with path.open("rb") as stream:
                state = _state_of(stream.fileno())
                tail = _FOOTER.size + len(MCAP0_MAGIC)
                stream.seek(max(0, state[0] - tail))
                opcode, _, begin, _, crc = _FOOTER.unpack(stream.read(_FOOTER.size))
                if opcode != Opcode.FOOTER or stream.read() != MCAP0_MAGIC or not 0 < begin <= state[0] - tail:
                    return None
                stream.seek(begin)
                data = stream.read(state[0] - begin - len(MCAP0_MAGIC))
            return cls._parsed(state, data) if zlib.crc32(data[:-4]) == crc else None
        except (OSError, ValueError, struct.error, EOFError):
            return None

    def check(self, path: Path) -> None:
        """Raise RecordingError unless the file is the one that this is the index of."""
        if not path.exists() or _state_of(path) != self.state:
            raise RecordingError(f"{path} has changed or gone since it was opened; open it again")

    @classmethod
    def _parsed(cls, state: tuple[int, int], data: bytes) -> Index:
        records: list[Schema | Channel] = []
        chunks: list[tuple[int, int, int]] = []
        metadata: list[Place] = []
        at = 0
        while at < len(data):
            opcode, length = _HEAD.unpack_from(data, at)
            at += _HEAD.size
            if opcode in _READ:
                records.append(_READ[opcode].read(ReadDataStream(io.BytesIO(data[at : at + length]))))
            elif opcode == Opcode.CHUNK_INDEX:
                _, _, begin, size, channels, channel = _CHUNK_INDEX.unpack_from(data, at)
                chunks += [(begin, size, channel)] if channels else []
            elif opcode == Opcode.METADATA_INDEX:
                metadata.append(_METADATA_INDEX.unpack_from(data, at))
            at += length
        topics = {record.id: record.topic for record in records if isinstance(record, Channel)}
        blocks: list[dict[str, Place]] = [{}]
        for begin, size, channel in chunks:  # a block's packets come after its tables
            topic = topics[channel]
            if topic == layout.PACKETS or topic.startswith(layout.TABLE):
                blocks[-1][topic] = begin, size
            if topic == layout.PACKETS:
                blocks.append({})
        return cls(state, records, blocks[:-1], metadata)


def _state_of(file: Path | int) -> tuple[int, int]:
    """Size in bytes and time of the last change in ns of a file, by its path or descriptor."""
    state = os.stat(file)
    return state.st_size, state.st_mtime_ns
