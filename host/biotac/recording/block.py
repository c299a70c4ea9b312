"""One block of a recording, about a second: a table per finger of its FRAMEs, PACs and heartbeats, and the rest.

A table has one column per field. A column is stored as the change from row to row (the first row's is from 0),
zigzag-encoded so that small changes are small numbers, as byte planes, lowest first: zstd compresses this well, and a
field can be read without the others. ``seq`` and ``t_us`` are unwrapped. The rest is all other messages as they came,
the order of all, and what the decoder counted as lost or damaged.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..wire import messages_gen as wire
from ..wire.batches import Batch
from ..wire.decoder import pairs
from ..wire.dtypes_gen import DTYPES
from ..wire.fields import FORCE_LSB_PER_N, WIRE_INVALID
from ..wire.frames import StructArray
from ..wire.native import ffi, lib

KINDS = (wire.Frame.ID, wire.Pac.ID, wire.Idle.ID)
FRAME, PAC, IDLE = range(len(KINDS))
APPLIED = "applied_100un"  #: a column of FRAMEs that no board sends: the force (3) on a simulated finger
#: In an order: the next of the other messages. Any other code is kind << 8 | finger: that finger's next row.
OTHER = 0xFFFF
_COUNTS = struct.Struct(f"<{len(KINDS)}I")  # rows of each kind, at the beginning of a table


class Column(NamedTuple):
    """A stored field: ``parts`` values per row."""

    name: str
    dtype: np.dtype[Any]
    parts: int


def row_dtype(kind: int) -> np.dtype[Any]:
    """Rows of one kind: the message's fields, with ``seq`` and ``t_us`` wide enough to be unwrapped."""
    sent = DTYPES[KINDS[kind]]
    wide = {"seq": np.dtype("<u4"), "t_us": np.dtype("<i8")}
    names = ["finger", *(name for name in sent.names or () if name != "finger")]
    own = [(APPLIED, np.dtype(("<i4", 3)))] if kind == FRAME else []
    return np.dtype([(name, wide.get(name, sent[name])) for name in names] + own)


ROWS = tuple(row_dtype(kind) for kind in range(len(KINDS)))
_COLUMNS = tuple(
    [Column(name, dtype[name].base, int(np.prod(dtype[name].shape))) for name in dtype.names or () if name != "finger"]
    for dtype in ROWS
)


def schema() -> bytes:
    """The columns of a table as JSON; stored in the recording."""
    kinds = zip(KINDS, _COLUMNS, strict=True)
    columns = {_name(message_id): [[c.name, c.dtype.str, c.parts] for c in columns] for message_id, columns in kinds}
    return json.dumps(columns).encode()


def _name(message_id: int) -> str:
    return wire.MESSAGES[message_id].__name__.upper()


@dataclass(frozen=True)
class Rest:
    """What a block holds beside its tables.

    ``others`` are all messages but rows, as (id, length, payload). ``fingers`` have a table. ``first_us`` and
    ``last_us`` are the first and last time of FRAMEs and heartbeats, None without any. ``lost`` has (finger, seq
    before, frames lost) for each loss found by the sequence numbers. ``rejected`` counts what came damaged, by the
    names of FramingCounts. ``frames``, ``frames_lost``, ``pac_lost`` and ``disordered`` count from the beginning of
    the file to the end of this block. ``gaps`` are times during which the board was away, before this block's first
    row. ``labels`` were made during the block.
    """

    order: NDArray[np.uint16]
    others: bytes
    fingers: list[int] = field(default_factory=list)
    first_us: int | None = None
    last_us: int | None = None
    lost: list[tuple[int, int, int]] = field(default_factory=list)
    rejected: dict[str, int] = field(default_factory=dict)
    frames: int = 0
    frames_lost: int = 0
    pac_lost: int = 0
    disordered: int = 0
    gaps: list[dict[str, Any]] = field(default_factory=list)
    labels: list[dict[str, Any]] = field(default_factory=list)

    def pack(self) -> bytes:
        """A line of JSON, the order, the other messages."""
        head = {name: value for name, value in vars(self).items() if name not in ("order", "others")}
        line = json.dumps(head | {"messages": len(self.order)}, separators=(",", ":"))
        return line.encode() + b"\n" + self.order.astype("<u2").tobytes() + self.others

    @classmethod
    def unpack(cls, data: bytes) -> Rest:
        """Inverse of ``pack``. Raises ValueError, TypeError or KeyError for anything else."""
        line, _, body = data.partition(b"\n")
        head = json.loads(line)
        size = 2 * int(head.pop("messages"))
        order = np.frombuffer(body[:size], "<u2")
        if 2 * len(order) != size:
            raise ValueError(f"the order of {size // 2} messages is cut off")
        head["lost"] = [(int(finger), int(before), int(frames)) for finger, before, frames in head["lost"]]
        head |= {name: int(head[name]) for name in ("frames", "frames_lost", "pac_lost", "disordered")}
        head["rejected"] = {str(kind): int(count) for kind, count in head["rejected"].items()}
        return cls(order, body[size:], **head)

    def finger_of_row(self, kind: int) -> NDArray[np.uint8]:
        """The finger of each row of ``kind``, in order of arrival."""
        fingers: NDArray[np.uint8] = self.order[self.order >> 8 == kind].astype(np.uint8)
        return fingers

    def without(self, fingers: Collection[int]) -> Rest:
        """A copy without the rows of ``fingers``."""
        excluded = np.isin(self.order & 0xFF, list(fingers)) & (self.order != OTHER)
        return Rest(**{**vars(self), "order": self.order[~excluded]})


def encode_block(
    batch: Batch, ids: bytes, applied_n: NDArray[np.float64] | None
) -> tuple[dict[int, bytes], NDArray[np.uint16]]:
    """Tables by finger of a batch's rows, and the order of all messages, whose ids are ``ids``."""
    frames = np.empty(len(batch.wire), ROWS[FRAME])
    applied = np.full(3, np.nan) if applied_n is None else np.clip(np.rint(applied_n * FORCE_LSB_PER_N), -2e9, 2e9)
    frames[APPLIED] = np.nan_to_num(applied, nan=wire.INVALID_I32)
    for name in DTYPES[wire.Frame.ID].names or ():
        frames[name] = batch.seq if name == "seq" else batch.t_us if name == "t_us" else batch.wire[name]
    tables = [frames, batch.pac, batch.idle]
    order = np.full(len(ids), OTHER, np.uint16)
    for kind, rows in enumerate(tables):
        order[np.frombuffer(ids, np.uint8) == KINDS[kind]] = kind << 8 | rows["finger"].astype(np.uint16)
    fingers = np.unique(order[order != OTHER] & 0xFF).tolist()
    return {f: _table([rows[rows["finger"] == f] for rows in tables]) for f in fingers}, order


def as_sent(rows: StructArray, kind: int) -> StructArray:
    """Messages of one kind with ``seq`` and ``t_us`` wrapped again; ``rows`` itself if it already has that dtype."""
    sent = DTYPES[KINDS[kind]]
    if rows.dtype == sent:
        return rows
    out = np.empty(len(rows), sent)
    for name in sent.names or ():
        out[name] = rows[name] & np.iinfo(sent[name]).max if name in ("seq", "t_us") else rows[name]
    return out


def messages_of(rest: Rest, rows: list[StructArray]) -> Iterator[tuple[int, bytes]]:
    """All messages of a block in order of arrival, as (id, payload); ``rows`` by kind."""
    payloads = [
        iter(as_sent(table, kind).view(f"V{DTYPES[KINDS[kind]].itemsize}").tolist()) for kind, table in enumerate(rows)
    ]
    others = iter(pairs(rest.others))
    for kind in (rest.order >> 8).tolist():
        yield (KINDS[kind], next(payloads[kind])) if kind < len(KINDS) else next(others)


# ---- tables -----------------------------------------------------------------------------------------


def _table(rows_of_kind: list[StructArray]) -> bytes:
    parts = [_COUNTS.pack(*map(len, rows_of_kind))]
    for columns, rows in zip(_COLUMNS, rows_of_kind, strict=True):
        for name, dtype, _ in columns if len(rows) else ():
            values = np.ascontiguousarray(rows[name].astype(dtype, copy=False)).reshape(len(rows), -1)
            parts.append(_planes(values))
    return b"".join(parts)


def _planes(values: NDArray[Any]) -> bytes:
    unsigned = values.view(f"<u{values.itemsize}")
    change = unsigned.copy()
    change[1:] -= unsigned[:-1]
    signed = change.view(f"<i{values.itemsize}")
    zigzag = (change << 1) ^ (signed >> (8 * values.itemsize - 1)).view(change.dtype)
    planes: NDArray[np.uint8] = zigzag.T.copy().reshape(-1, 1).view(np.uint8).T
    return planes.tobytes()


class TableReader:
    """Reads tables of the columns that ``schema`` wrote, and of these only the fields ``wanted``, by kind.

    Raises ValueError, KeyError or TypeError for another schema.
    """

    def __init__(self, text: bytes, wanted: Mapping[int, Collection[str]]) -> None:
        stored = json.loads(text)
        self._kinds = [_KindReader(kind, stored[_name(KINDS[kind])], wanted.get(kind)) for kind in range(len(KINDS))]

    def rows(self, kind: int, fingers: NDArray[np.uint8]) -> StructArray:
        """Rows of these fingers, for ``read`` to fill; fields that the recording does not have are invalid."""
        reader = self._kinds[kind]
        rows = np.empty(len(fingers), reader.dtype)
        rows["finger"] = fingers
        for name in reader.missing:
            rows[name] = WIRE_INVALID.get(reader.dtype[name].base.str[1:], 0)
        return rows

    def read(self, data: bytes, finger: int, rows_of_kind: list[StructArray]) -> None:
        """Fill a finger's rows. Raises ValueError or struct.error if the table has another size than they."""
        counts = _COUNTS.unpack_from(data)
        size = _COUNTS.size + sum(n * reader.row_bytes for n, reader in zip(counts, self._kinds, strict=True))
        if size != len(data):
            raise ValueError(f"a finger's table of {len(data)} bytes, expected {size}")
        begin = _COUNTS.size
        for n, reader, rows in zip(counts, self._kinds, rows_of_kind, strict=True):
            end = begin + n * reader.row_bytes
            if reader.wanted:
                at = np.flatnonzero(rows["finger"] == finger).astype(np.uint32)
                if len(at) != n:
                    raise ValueError(f"a finger's table of {n} rows, expected {len(at)}")
                reader.read(memoryview(data)[begin:end], rows, at)
            begin = end


class _KindReader:
    def __init__(self, kind: int, stored: list[list[Any]], wanted: Collection[str] | None) -> None:
        columns = [Column(str(name), np.dtype(dtype), int(parts)) for name, dtype, parts in stored]
        if any(column.dtype.kind not in "iu" or not 0 < column.parts <= 64 for column in columns):
            raise ValueError("a column is not of integers, or not 1 to 64 wide")
        chosen = {"finger", *(wanted or ())}
        self.wanted = wanted is not None
        self.dtype = np.dtype([(name, ROWS[kind][name]) for name in ROWS[kind].names or () if name in chosen])
        self.row_bytes = sum(column.dtype.itemsize * column.parts for column in columns)
        fields = dict(self.dtype.fields or {})
        del fields["finger"]
        specs = []
        for name, stored_dtype, parts in columns:
            own = fields.pop(name, None)
            if own is not None and (own[0].base, int(np.prod(own[0].shape))) != (stored_dtype, parts):
                raise ValueError(f"{name} is {parts} x {stored_dtype}, expected {own[0]}")
            specs.append((stored_dtype.itemsize, parts, -1 if own is None else own[1]))
        self.missing = list(fields)
        self._columns = ffi.new("bt_stored_column[]", specs)

    def read(self, planes: memoryview, rows: StructArray, at: NDArray[np.uint32]) -> None:
        """Decode ``len(at) * row_bytes`` bytes into the rows ``at``."""
        source, out = (ffi.from_buffer("uint8_t[]", data) for data in (planes, rows))
        index = ffi.from_buffer("uint32_t[]", at)
        lib.bt_columns(source, len(at), self._columns, len(self._columns), index, out, rows.dtype.itemsize)
