"""A wrench map as a board stores it: the blob, and the board's own code that runs it.

The blob's layout and the meaning of the integers are in protocol/SPEC.md, Wrench maps.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..kernels import compiled
from ..kernels.compiled import BoardResults, Settings, integers
from ..wire import map_gen as _map
from ..wire import messages_gen as wire
from ..wire.frames import StructArray
from ..wire.identity import ascii_text
from ..wire.map_gen import Gate, Kind
from ..wire.native import ffi, lib
from . import lesson as _lesson
from .columns import GATED
from .lesson import Lesson, Seen
from .margin import UNKNOWN, Margin

Integers = NDArray[np.int64]

_HEADER = struct.Struct(f"<BBBB{_map.SERIAL_BYTES}sI4H")
_BLOCK = struct.Struct(f"<BB{_map.EXPONENTS}B")
_SERIAL = slice(4, 4 + _map.SERIAL_BYTES)
PART_BYTES = len(wire.MapData.unpack(bytes(wire.MapData.STRUCT.size)).data)
_ELECTRODES = _map.KINDS[Kind.SIGNAL].columns


def _ring() -> NDArray[np.intp]:
    """For each pair in the blob's order, the index in i <= j, row by row: each electrode with itself and the next 9."""
    index = np.zeros((_ELECTRODES, _ELECTRODES), np.intp)
    upper = np.triu_indices(_ELECTRODES)
    index[upper] = np.arange(len(upper[0]))
    first, behind = np.indices((_ELECTRODES, (_ELECTRODES + 1) // 2)).reshape(2, -1)
    second = (first + behind) % _ELECTRODES
    ring: NDArray[np.intp] = index[np.minimum(first, second), np.maximum(first, second)]
    return ring


RING = _ring()


@dataclass(frozen=True)
class BoardBlock:
    """``coefficients`` (columns, axes) of ``kind``'s columns, over 2^``exponent`` (axes,); pairs i <= j, row by row."""

    kind: Kind
    gate: Gate
    exponent: tuple[int, ...]
    coefficients: Integers


@dataclass(frozen=True)
class BoardMap:
    """A wrench map. ``axes`` is 3 (force), 6 (and torque) or 7 (and torsion).

    ``serial`` is that of the sensor it was made for, "" for any. ``made_s`` counts from 1970 UTC, 0: unknown.
    ``margin`` is the force's, ``lesson`` the touches that it was fitted to; without one a board trusts it less.
    """

    axes: int
    blocks: tuple[BoardBlock, ...]
    serial: str = ""
    made_s: int = 0
    margin: Margin = UNKNOWN
    lesson: Lesson | None = None

    @cached_property
    def blob(self) -> bytes:
        """The bytes that a board stores. Raises InputError when the board would refuse them."""
        try:
            blob = self.packed()
        except (struct.error, UnicodeEncodeError, ValueError) as error:
            raise InputError(f"a wrench map cannot be stored ({error}); see protocol/SPEC.md, Wrench maps") from error
        _opened(blob)
        return blob

    def packed(self) -> bytes:
        """The bytes, whether or not a board would accept them. Raises as struct.pack."""
        serial = self.serial.encode("ascii")
        if len(serial) > _map.SERIAL_BYTES:
            raise ValueError(f"the serial number {self.serial!r} has more than {_map.SERIAL_BYTES} characters")
        margin = [value for pair in zip(self.margin.base_mn, self.margin.share_q8, strict=True) for value in pair]
        taught = 0 if self.lesson is None else _lesson.VERSION
        head = _HEADER.pack(_map.VERSION, self.axes, len(self.blocks), taught, serial, self.made_s, *margin)
        head += b"" if self.lesson is None else self.lesson.packed()
        blocks, coefficients = b"", b""
        for block in self.blocks:
            unused = (0,) * (_map.EXPONENTS - self.axes)
            blocks += _BLOCK.pack(block.kind, block.gate, *block.exponent, *unused)
            shape = _map.KINDS[block.kind].columns, self.axes
            values = integers(f"coefficients of {block.kind.name}", block.coefficients, np.int64, *shape)
            coefficients += b"".join(_halves(block.kind, group) for group in np.split(values, [3], axis=1))
        return head + blocks + coefficients

    @property
    def with_pdc(self) -> bool:
        """Whether the results need PDC."""
        return any(block.kind == Kind.PRESSURE for block in self.blocks)

    @property
    def is_population(self) -> bool:
        """Whether it has the population map's blocks, and boards compare touches with that map's training."""
        return self.axes == _map.AXES_FORCE and {(block.kind, block.gate) for block in self.blocks} == set(GATED)

    @property
    def handle(self) -> Any:
        """The C struct bt_map, valid as long as this object lives."""
        return self._open[0]

    @cached_property
    def _open(self) -> tuple[Any, Any]:
        return _opened(self.blob)

    def results(
        self, counts: NDArray[np.uint16], tare_q4: NDArray[np.uint16], pdc_above_rest_q4: NDArray[np.int32]
    ) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
        """force_100un, torque_mnmm (n, 3), torsion_mnmm (n,) by the board's code, before on_board_q4() mixes them.

        counts and tare_q4 are (n, 19), pressure (n,). A result is -2^31 where invalid: if the map does not have it, and
        in rows where the map needs pressure and that is missing (-2^31). Raises ValueError for other shapes or ranges.
        """
        return compiled.map_results_q4(counts, tare_q4, pdc_above_rest_q4, self.handle)[:3]

    def seen(
        self, counts: NDArray[np.uint16], tare_q4: NDArray[np.uint16], pdc_above_rest_q4: NDArray[np.int32]
    ) -> Seen:
        """The factors that the lesson is compared with, by the board's code; arguments as results()."""
        force_100un, _, _, factors = compiled.map_results_q4(counts, tare_q4, pdc_above_rest_q4, self.handle)
        return Seen(factors.astype(np.int64), force_100un.astype(np.int64))


def from_blob(blob: bytes) -> BoardMap:
    """Inverse of BoardMap.blob, to the bit. Raises InputError when a board would refuse it."""
    _opened(blob)
    _, axes, count, taught, serial, made_s, normal_mn, normal_q8, shear_mn, shear_q8 = _HEADER.unpack_from(blob)
    at = _map.HEADER_BYTES + (_lesson.BYTES if taught else 0)
    lesson = Lesson.unpacked(blob[_map.HEADER_BYTES : at]) if taught == _lesson.VERSION else None
    heads = [_BLOCK.unpack_from(blob, at + k * _map.BLOCK_BYTES) for k in range(count)]
    at += count * _map.BLOCK_BYTES
    blocks = []
    for kind, gate, *exponent in heads:
        groups = []
        for width in (3, axes - 3):
            halves = _map.KINDS[Kind(kind)].halves * width
            groups.append(_columns(Kind(kind), np.frombuffer(blob, "<i2", halves, at).reshape(-1, width or 1)))
            at += 2 * halves
        values = np.concatenate(groups if axes > 3 else groups[:1], axis=1)
        blocks.append(BoardBlock(Kind(kind), Gate(gate), tuple(exponent[:axes]), values))
    margin = Margin((normal_mn, shear_mn), (normal_q8, shear_q8))
    return BoardMap(axes, tuple(blocks), serial.rstrip(b"\0").decode("ascii", "replace"), made_s, margin, lesson)


def opened(board_map: BoardMap | bytes) -> BoardMap:
    """The map itself, or the one in a blob. Raises InputError when a board would refuse the blob."""
    return board_map if isinstance(board_map, BoardMap) else from_blob(board_map)


# ---- a blob as it is moved: the board checks it -------------------------------------------------


def as_blob(board_map: bytes | BoardMap) -> bytes:
    """The bytes of a map. Raises InputError for a size that no map has; the board checks the rest."""
    blob = board_map.blob if isinstance(board_map, BoardMap) else bytes(board_map)
    if not _map.HEADER_BYTES <= len(blob) <= _map.MAX_BYTES:
        raise InputError(
            f"the map has {len(blob)} bytes, expected {_map.HEADER_BYTES} to {_map.MAX_BYTES}; is it a wrench map?"
        )
    return blob


def serial_of(blob: bytes) -> str:
    """Serial number of the sensor that the map was made for; "" for any sensor."""
    return ascii_text(blob[_SERIAL])


def made_s_of(blob: bytes) -> int:
    """When the map was made, in seconds since 1970 UTC; 0 when unknown."""
    return int.from_bytes(blob[_SERIAL.stop : _SERIAL.stop + 4], "little")


def for_any_sensor(blob: bytes) -> bytes:
    """The same map without a serial number."""
    return blob[: _SERIAL.start] + bytes(_map.SERIAL_BYTES) + blob[_SERIAL.stop :]


def info(blob: bytes, req_id: int, finger: int) -> wire.MapInfo:
    """The MAP_INFO that a board with this map in force sends."""
    state, serial = wire.CalibrationState.IN_FORCE, tuple(blob[_SERIAL])
    return wire.MapInfo(req_id, finger, state, serial, made_s_of(blob), len(blob), zlib.crc32(blob))


def part(blob: bytes, offset: int) -> tuple[int, ...]:
    """The part of the map at ``offset`` that READ_MAP and WRITE_MAP carry, padded with 0xFF."""
    return tuple(blob[offset : offset + PART_BYTES].ljust(PART_BYTES, b"\xff"))


# ---- on a board --------------------------------------------------------------------------------


def on_board_q4(frames: StructArray, settings: Settings, own_map: BoardMap | None) -> BoardResults:
    """compiled.on_board_q4() on FRAME messages (n,), with a map in force or without."""
    by_map = () if own_map is None else (own_map.handle, pdc_above_rest_q4(frames))
    return compiled.on_board_q4(frames["counts"], frames["tare_q4"], settings, *by_map)


def pdc_above_rest_q4(frames: StructArray) -> NDArray[np.int32]:
    """PDC above its tare from FRAME messages (n,), in 1/16 count; -2^31 where either is missing."""
    missing = (frames["pdc"] == wire.INVALID_COUNT) | (frames["pdc_tare_q4"] == wire.INVALID_COUNT)
    above = 16 * frames["pdc"].astype(np.int32) - frames["pdc_tare_q4"]
    return np.where(missing, wire.INVALID_I32, above).astype(np.int32)


def _halves(kind: Kind, values: Integers) -> bytes:
    """The bytes of a group of axes (columns, width) in the blob. Raises ValueError for values beyond 16 bits."""
    spec = _map.KINDS[kind]
    halves = integers(f"coefficients of {kind.name}", values, "<i2", None, None)
    laid = np.zeros((spec.halves, values.shape[1]), "<i2")
    laid[: spec.columns] = halves[RING] if spec.shape == "pairs" else halves
    return laid.tobytes()


def _columns(kind: Kind, laid: NDArray[Any]) -> Integers:
    """Inverse of _halves, on an array of the integers in the blob."""
    spec = _map.KINDS[kind]
    values = np.zeros((spec.columns, laid.shape[1]), np.int64)
    if len(laid):
        values[RING if spec.shape == "pairs" else slice(None)] = laid[: spec.columns]
    return values


def is_accepted(board_map: BoardMap) -> bool:
    """Whether a board accepts this map, by firmware/core/map/open.c."""
    return _parsed(board_map.packed())[0] == wire.Error.OK


def _opened(blob: bytes) -> tuple[Any, Any]:
    """A bt_map into a copy of the blob, and that copy. Raises InputError when the board would refuse it."""
    error, handle, words = _parsed(blob)
    if error != wire.Error.OK:
        raise InputError(
            f"the board would refuse this wrench map of {len(blob)} bytes ({wire.Error(error).name}): expected at most "
            f"{_map.MAX_BYTES} bytes, version {_map.VERSION}, laid out as in protocol/SPEC.md; make the map again"
        )
    return handle, words


def _parsed(blob: bytes) -> tuple[int, Any, Any]:
    words = ffi.new("uint32_t[]", len(blob) // 4 + 1)  # for alignment
    ffi.memmove(words, blob, len(blob))
    handle = ffi.new("bt_map *")
    return lib.bt_map_open(handle, ffi.cast("uint8_t *", words), len(blob)), handle, words
