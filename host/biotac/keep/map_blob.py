"""A wrench map as the board holds it: bytes, of which only the header is read here."""

from __future__ import annotations

import zlib

from ..core.board_map import BoardMap
from ..core.map_versions import current
from ..errors import InputError
from ..wire import map_gen as _map
from ..wire import messages_gen as wire
from ..wire.identity import ascii_text

SERIAL_AT = 4
MADE_AT = SERIAL_AT + _map.SERIAL_BYTES


def as_blob(its: bytes | BoardMap) -> bytes:
    """The bytes of a map, in the current version. The board checks all but the size.

    Raises InputError for a size that no map has, or a map of version 1 that cannot be read.
    """
    blob = its.blob if isinstance(its, BoardMap) else current(bytes(its))
    if not _map.HEADER_BYTES <= len(blob) <= _map.MAX_BYTES:
        raise InputError(
            f"the map has {len(blob)} bytes, expected {_map.HEADER_BYTES} to {_map.MAX_BYTES}; is it a wrench map?"
        )
    return blob


def serial(blob: bytes) -> str:
    """Serial number of the sensor that the map was made for; "" for any sensor."""
    return ascii_text(blob[SERIAL_AT : SERIAL_AT + _map.SERIAL_BYTES])


def made_s(blob: bytes) -> int:
    """When the map was made, in seconds since 1970 UTC; 0 when unknown."""
    return int.from_bytes(blob[MADE_AT : MADE_AT + 4], "little")


def for_any_sensor(blob: bytes) -> bytes:
    """The same map without a serial number."""
    return blob[:SERIAL_AT] + bytes(_map.SERIAL_BYTES) + blob[SERIAL_AT + _map.SERIAL_BYTES :]


def info(blob: bytes, req_id: int, finger: int) -> wire.MapInfo:
    """The MAP_INFO that a board with this map in force sends."""
    told = tuple(blob[SERIAL_AT : SERIAL_AT + _map.SERIAL_BYTES])
    return wire.MapInfo(req_id, finger, wire.CalibrationState.IN_FORCE, told, made_s(blob), len(blob), zlib.crc32(blob))


def part(blob: bytes, offset: int) -> tuple[int, ...]:
    """The part of the map at ``offset`` that READ_MAP and WRITE_MAP carry, padded with 0xFF."""
    return tuple(blob[offset : offset + PART_BYTES].ljust(PART_BYTES, b"\xff"))


PART_BYTES = len(wire.MapData.unpack(bytes(wire.MapData.STRUCT.size)).data)
