"""Moving a wrench map to a board and back, in parts; each part is a command, repeated until it is answered."""

from __future__ import annotations

import zlib

from ..board.board import Board
from ..errors import CommandRefusedError, InputError, PortError
from ..map.board_map import PART_BYTES, part
from ..wire import messages_gen as wire
from ..wire.identity import board_name, maps_text

TRIES = 3


def write(board: Board, finger: int, blob: bytes) -> None:
    """Upload a map, put it into force, and read it back to check it.

    Raises InputError for a map that the board has no room for; CommandRefusedError with the board's reason; PortError
    when other bytes read back.
    """
    if len(blob) > board.info.map_bytes:
        raise InputError(
            f"a wrench map of {len(blob)} bytes, but {board_name(board.info)} keeps {maps_text(board.info)}: choose "
            "a smaller map, or set force_model and the gains (biotac calibrate put)"
        )
    for left in reversed(range(TRIES)):
        try:
            _write(board, finger, blob)
            break
        except CommandRefusedError as refused:
            # The board was away in the middle, or somebody else began another upload.
            if refused.error not in (wire.Error.NOT_BEGUN, wire.Error.NOT_WHOLE) or not left:
                raise
    if read(board, finger) != blob:
        raise PortError(
            f"finger {finger} reads back a different map than was written; close other programs and try again"
        )


def _write(board: Board, finger: int, blob: bytes) -> None:
    crc32 = zlib.crc32(blob)
    board.command(wire.BeginMap(0, finger, len(blob), crc32))
    for offset in range(0, len(blob), PART_BYTES):
        board.command(wire.WriteMap(0, finger, offset, part(blob, offset)))
    board.command(wire.EndMap(0, finger, crc32))


def info(board: Board, finger: int) -> wire.MapInfo:
    return board.ask(wire.GetMap(0, finger), wire.MapInfo)


def restore(board: Board, finger: int, blob: bytes) -> None:
    """Upload this map to the finger unless it has it already."""
    held = info(board, finger)
    if (held.size_bytes, held.crc32) != (len(blob), zlib.crc32(blob)):
        write(board, finger, blob)


def read(board: Board, finger: int) -> bytes | None:
    """A finger's map, in force or not; None without one. Raises PortError when it does not arrive intact."""
    for _ in range(TRIES):  # the map may be replaced meanwhile
        held = info(board, finger)
        if held.state == wire.CalibrationState.NONE:
            return None
        offsets = range(0, held.size_bytes, PART_BYTES)
        try:
            parts = [bytes(board.ask(wire.ReadMap(0, finger, offset), wire.MapData).data) for offset in offsets]
        except CommandRefusedError as refused:
            if refused.error != wire.Error.OUT_OF_RANGE:
                raise
            continue
        blob = b"".join(parts)[: held.size_bytes]
        if zlib.crc32(blob) == held.crc32:
            return blob
    raise PortError(
        f"the map of finger {finger} did not arrive intact in {TRIES} tries; close other programs and try again"
    )
