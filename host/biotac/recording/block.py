"""A block of the wire, about one second, split by finger and field and reassembled byte for byte.

A finger's part holds its FRAMEs, PACs and heartbeats, one column per field. A column holds the change from row to row
(the first row's is from 0), zigzag-encoded so that small changes are small numbers, as byte planes, lowest first. zstd
compresses this well, and a field can be read without the others. ``seq`` and ``t_us`` are unwrapped. The rest of a
block is the order of the messages, and all other messages as they came.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..wire import messages_gen as wire
from ..wire.batches import Batch
from ..wire.dtypes_gen import DTYPES
from ..wire.fields import WIRE_INVALID
from ..wire.frames import StructArray
from ..wire.native import ffi, lib

KINDS = (wire.Frame.ID, wire.Pac.ID, wire.Idle.ID)
FRAME, PAC, IDLE = range(len(KINDS))
_RAW = int(lib.BT_REBUILD_RAW)
_FINGER_BITS = 3  # a code is a kind and a finger
_ROWS = struct.Struct("<3I")
_HEAD = struct.Struct("<qqI")  # first and last t_us of the FRAMEs and heartbeats, number of codes that follow
_MOST_PER_MESSAGE = 256
_MOST_MESSAGES = 1 << 16  # per block; one second of five fingers is about 1100

#: Name, dtype of a value, values per row.
Column = tuple[str, np.dtype[Any], int]


def _columns(message_id: int) -> dict[str, np.dtype[Any]]:
    """Columns of one kind: the message's fields without the finger, with seq and t_us unwrapped."""
    fields = {name: DTYPES[message_id][name] for name in DTYPES[message_id].names or () if name != "finger"}
    return fields | {"seq": np.dtype("<u4"), "t_us": np.dtype("<i8")}


COLUMNS = tuple(_columns(message_id) for message_id in KINDS)


def schema() -> bytes:
    """The columns of a finger's part as JSON; stored in the recording."""
    kinds = {
        wire.MESSAGES[message_id].__name__.upper(): [
            [name, dtype.base.str, int(np.prod(dtype.shape))] for name, dtype in columns.items()
        ]
        for message_id, columns in zip(KINDS, COLUMNS, strict=True)
    }
    return json.dumps(kinds).encode()


@dataclass(frozen=True)
class Rest:
    """The order of a block's messages, as codes, and the messages that are not rows, as they came."""

    first_us: int
    last_us: int
    codes: NDArray[np.uint8]
    raw: bytes

    def pack(self) -> bytes:
        """Inverse of ``unpack``."""
        return _HEAD.pack(self.first_us, self.last_us, len(self.codes)) + self.codes.tobytes() + self.raw

    @classmethod
    def unpack(cls, data: bytes) -> Rest:
        """Inverse of ``pack``. Raises ValueError or struct.error for invalid data."""
        first_us, last_us, n = _HEAD.unpack_from(data)
        if n > _MOST_MESSAGES:
            raise ValueError(f"a block of {n} messages, expected at most {_MOST_MESSAGES}")
        return cls(first_us, last_us, np.frombuffer(data, np.uint8, n, _HEAD.size), data[_HEAD.size + n :])

    def fingers(self, kind: int) -> NDArray[np.uint8]:
        """The finger of each message of ``kind``, in order of arrival."""
        mine = self.codes[(self.codes != _RAW) & (self.codes >> _FINGER_BITS == kind)]
        fingers: NDArray[np.uint8] = mine & ((1 << _FINGER_BITS) - 1)
        return fingers

    def without(self, fingers: Collection[int]) -> Rest:
        """A copy without the rows of ``fingers``."""
        gone = np.isin(self.codes & ((1 << _FINGER_BITS) - 1), list(fingers)) & (self.codes != _RAW)
        return Rest(self.first_us, self.last_us, self.codes[~gone], self.raw)

    @property
    def all_fingers(self) -> set[int]:
        """Fingers with at least one row."""
        there = np.bincount(self.codes, minlength=256)[:_RAW].nonzero()[0]
        return set((there & ((1 << _FINGER_BITS) - 1)).tolist())


@dataclass(frozen=True)
class Block:
    """A block split up. ``parts`` by finger, encoded; ``read_part`` reads them."""

    parts: dict[int, bytes]
    rest: Rest


def take_apart(data: bytes, batch: Batch) -> Block | None:
    """Split up ``data``, whole messages whose decoded rows are ``batch``; None if it could not be reassembled."""
    if data.count(0) > _MOST_MESSAGES:
        return None
    pieces = data.split(b"\0")[:-1]
    ids = np.array([piece[1] if len(piece) > 1 else 0 for piece in pieces], np.intp)  # the id follows COBS's first byte
    codes = np.full(len(pieces), _RAW, np.uint8)
    tables = _tables(batch)
    for kind, rows in enumerate(tables):
        at = np.flatnonzero(ids == KINDS[kind])
        if len(at) != len(rows) or (rows["finger"] >= 1 << _FINGER_BITS).any():
            return None
        codes[at] = kind << _FINGER_BITS | rows["finger"]
    raw = b"".join(pieces[k] + b"\0" for k in np.flatnonzero(codes == _RAW).tolist())
    ends = [rows["t_us"] for rows in (tables[FRAME], tables[IDLE]) if len(rows)]
    first_us, last_us = (min(int(t.min()) for t in ends), max(int(t.max()) for t in ends)) if ends else (0, 0)
    rest = Rest(first_us, last_us, codes, raw)
    if together(rest, [as_sent(rows, kind) for kind, rows in enumerate(tables)]) != data:
        return None
    parts = {
        finger: b"".join(_encoded([rows[rows["finger"] == finger] for rows in tables])) for finger in rest.all_fingers
    }
    return Block(parts, rest)


def _tables(batch: Batch) -> list[StructArray]:
    """FRAMEs as sent, but with seq and t_us unwrapped; those of PAC and heartbeats already are."""
    frames = np.empty(len(batch.wire), table_dtype(FRAME))
    for name in frames.dtype.names or ():
        frames[name] = batch.seq if name == "seq" else batch.t_us if name == "t_us" else batch.wire[name]
    return [frames, batch.pac, batch.idle]


#: Bytes of finger, seq and t_us at the start of a table's row; messages start with the same three fields.
_LEAD = 1 + 4 + 8


def table_dtype(kind: int) -> np.dtype[Any]:
    return np.dtype([("finger", "u1"), *((name, dtype) for name, dtype in COLUMNS[kind].items())])


def as_sent(rows: StructArray, kind: int) -> StructArray:
    """Messages of one kind with seq and t_us wrapped again; ``rows`` itself if it already has that dtype."""
    sent = DTYPES[KINDS[kind]]
    if rows.dtype == sent:
        return rows
    out = np.empty(len(rows), sent)
    out["finger"] = rows["finger"]
    for name in ("seq", "t_us"):
        out[name] = rows[name] & np.iinfo(sent[name]).max
    rest = rows.dtype.itemsize - _LEAD  # the same in both, so one copy per row
    _bytes(out)[:, -rest:] = _bytes(rows)[:, -rest:]
    return out


def _bytes(rows: StructArray) -> NDArray[np.uint8]:
    return rows.view(np.uint8).reshape(len(rows), rows.dtype.itemsize)


def together(rest: Rest, sent: list[StructArray]) -> bytes:
    """The wire bytes of ``sent``, the messages by kind, each kind in order of arrival."""
    n = 1 << _FINGER_BITS
    tables, sizes, ids = (ffi.new(f"{kind}[64]") for kind in ("uint8_t const *", "uint32_t", "uint8_t"))
    keep = []
    for kind, rows in enumerate(sent):
        finger = rows["finger"]
        for one in np.unique(finger).tolist():
            mine = rows[finger == one]
            keep.append(ffi.from_buffer("uint8_t[]", mine))
            code = kind * n + one
            tables[code], sizes[code], ids[code] = keep[-1], rows.dtype.itemsize, KINDS[kind]
    out = ffi.new("uint8_t[]", _MOST_PER_MESSAGE * len(rest.codes) + len(rest.raw) + 1)
    codes = rest.codes.tobytes()
    size = lib.bt_rebuild(codes, len(codes), tables, sizes, ids, rest.raw, len(rest.raw), out)
    data: bytes = ffi.buffer(out, size)[:]
    return data


# ---- columns ----------------------------------------------------------------------------------------


def _encoded(tables: list[StructArray]) -> Iterator[bytes]:
    yield _ROWS.pack(*map(len, tables))
    for columns, rows in zip(COLUMNS, tables, strict=True):
        for name, dtype in columns.items() if len(rows) else ():
            values = np.ascontiguousarray(rows[name].astype(dtype.base, copy=False)).reshape(len(rows), -1)
            yield _planes(values)


def _planes(values: NDArray[Any]) -> bytes:
    unsigned = values.view(f"<u{values.itemsize}")
    change = unsigned.copy()
    change[1:] -= unsigned[:-1]
    signed = change.view(f"<i{values.itemsize}")
    zigzag = (change << 1) ^ (signed >> (8 * values.itemsize - 1)).view(change.dtype)
    planes: NDArray[np.uint8] = zigzag.T.copy().reshape(-1, 1).view(np.uint8).T
    return planes.tobytes()


class Reading:
    """Turns the stored columns of one kind into rows of the fields ``wanted``; None: into no rows at all."""

    def __init__(self, kind: int, columns: list[Column], wanted: Collection[str] | None) -> None:
        full = table_dtype(kind)
        chosen = {"finger", *(wanted or ())}
        self.dtype = np.dtype([(name, full[name]) for name in full.names or () if name in chosen])
        self.wanted = wanted is not None
        self.row_bytes = sum(stored.itemsize * parts for _, stored, parts in columns)
        fields = dict(self.dtype.fields or {})
        del fields["finger"]
        specs = []
        for name, stored, parts in columns:
            its = fields.pop(name, None)
            if its is not None and (its[0].base, int(np.prod(its[0].shape))) != (stored, parts):
                raise ValueError(f"{name} is {parts} x {stored}, expected {its[0]}")
            specs.append((stored.itemsize, parts, -1 if its is None else its[1]))
        self._columns = ffi.new("bt_stored_column[]", specs)
        self._missing = list(fields)
        self.nothing = self.table(np.empty(0, np.uint8))

    def table(self, finger: NDArray[np.uint8]) -> StructArray:
        """Rows of these fingers, for ``read`` to fill; fields that the recording's version did not have are invalid."""
        rows = np.empty(len(finger), self.dtype)
        rows["finger"] = finger
        for name in self._missing:
            rows[name] = WIRE_INVALID.get(self.dtype[name].base.str[1:], 0)
        return rows

    def read(self, planes: memoryview, rows: StructArray, at: NDArray[np.uint32]) -> None:
        """Decode a part's columns of this kind, ``len(at) * row_bytes`` bytes, into the rows ``at`` of a table."""
        source, index, out = (
            ffi.from_buffer("uint8_t[]", planes),
            ffi.from_buffer("uint32_t[]", at),
            ffi.from_buffer("uint8_t[]", rows),
        )
        lib.bt_columns(source, len(at), self._columns, len(self._columns), index, out, rows.dtype.itemsize)


def read_part(data: bytes, readings: Sequence[Reading], tables: list[StructArray], finger: int) -> None:
    """Decode a finger's part into its rows of ``tables``, by kind. Raises ValueError or struct.error for wrong size."""
    counts = _ROWS.unpack_from(data)
    expected = _ROWS.size + sum(n * reading.row_bytes for n, reading in zip(counts, readings, strict=True))
    if expected != len(data):
        raise ValueError(f"a finger's part of {len(data)} bytes, expected {expected}")
    begin = _ROWS.size
    for n, reading, rows in zip(counts, readings, tables, strict=True):
        end = begin + n * reading.row_bytes
        if reading.wanted:
            at = np.flatnonzero(rows["finger"] == finger).astype(np.uint32)
            if len(at) != n:
                raise ValueError(f"a finger's part of {n} rows, expected {len(at)}")
            reading.read(memoryview(data)[begin:end], rows, at)
        begin = end


def layout_of(text: bytes) -> list[list[Column]]:
    """The columns by kind that ``schema`` wrote. Raises ValueError, KeyError or TypeError for anything else."""
    kinds = json.loads(text)
    out = []
    for message_id in KINDS:
        columns = [(str(n), np.dtype(d), int(p)) for n, d, p in kinds[wire.MESSAGES[message_id].__name__.upper()]]
        if any(dtype.kind not in "iu" or not 0 < parts <= 64 for _, dtype, parts in columns):
            raise ValueError("a column is not of integers, or not 1 to 64 wide")
        out.append(columns)
    return out
