"""Moving a wrench map to a board and back, in parts, each of which is asked for or told until it is answered."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from typing import Any

from ..errors import CommandRefusedError, PortError
from ..keep.map_blob import PART_BYTES, part
from ..wire import messages_gen as wire

TRIES = 3

#: Gives a command, without its req_id, and returns the reply of this type.
Ask = Callable[[Callable[[int], Any], type[Any]], Any]


def write(ask: Ask, finger: int, blob: bytes) -> None:
    """Upload a map and put it into force; afterwards it has been read back.

    Raises CommandRefusedError with the board's reason; PortError when other bytes come back.
    """
    for left in reversed(range(TRIES)):
        try:
            _write(ask, finger, blob)
            break
        except CommandRefusedError as refused:
            # The board was away in the middle, or somebody else began another one.
            if refused.error not in (wire.Error.NOT_BEGUN, wire.Error.NOT_WHOLE) or not left:
                raise
    if read(ask, finger) != blob:
        raise PortError(f"finger {finger} reads back another map than was written; is somebody else on this board?")


def _write(ask: Ask, finger: int, blob: bytes) -> None:
    crc32 = zlib.crc32(blob)
    ask(lambda req_id: wire.BeginMap(req_id, finger, len(blob), crc32), wire.Reply)
    for offset in range(0, len(blob), PART_BYTES):
        data = part(blob, offset)
        ask(lambda req_id, at=offset, data=data: wire.WriteMap(req_id, finger, at, data), wire.Reply)  # type: ignore[misc]
    ask(lambda req_id: wire.EndMap(req_id, finger, crc32), wire.MapInfo)


def info(ask: Ask, finger: int) -> wire.MapInfo:
    """Which map a finger has."""
    told: wire.MapInfo = ask(lambda req_id: wire.GetMap(req_id, finger), wire.MapInfo)
    return told


def read(ask: Ask, finger: int) -> bytes | None:
    """A finger's map, in force or not; None without one. PortError when its bytes do not come whole."""
    for _ in range(TRIES):  # it may be replaced meanwhile
        told = info(ask, finger)
        if told.state == wire.CalibrationState.NONE:
            return None
        try:
            parts = [_part(ask, finger, offset) for offset in range(0, told.size_bytes, PART_BYTES)]
        except CommandRefusedError as refused:
            if refused.error != wire.Error.OUT_OF_RANGE:
                raise
            continue
        blob = b"".join(parts)[: told.size_bytes]
        if zlib.crc32(blob) == told.crc32:
            return blob
    raise PortError(f"the map of finger {finger} does not come whole, {TRIES} times over; is it being changed?")


def _part(ask: Ask, finger: int, offset: int) -> bytes:
    return bytes(ask(lambda req_id: wire.ReadMap(req_id, finger, offset), wire.MapData).data)
