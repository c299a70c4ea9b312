"""A contestant: the same content as one protobuf message per frame, in MCAP with the library's default settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader
from mcap_protobuf.writer import Writer
from numpy.typing import NDArray

from biotac import Recording
from biotac.wire import DTYPES, messages

#: By kind and finger, arrays (n,) or (n, parts) of the wire's integers by field; ``seq`` and ``t_us`` are unwrapped.
Columns = dict[tuple[str, int], dict[str, NDArray[Any]]]

_OF_KIND = {"frames": messages.Frame.ID, "pac": messages.Pac.ID, "idle": messages.Idle.ID}
_FIELD = descriptor_pb2.FieldDescriptorProto


def columns_of(recording: Recording) -> Columns:
    """The columns of a recording."""
    out: Columns = {}
    unwrapped = {"seq": recording.seq, "t_us": recording.t_us}
    for kind, rows in (("frames", recording.wire), ("pac", recording.pac), ("idle", recording.idle)):
        counters = unwrapped if kind == "frames" else {name: rows[name].astype(np.int64) for name in unwrapped}
        for finger in np.unique(rows["finger"]).tolist():
            of_finger = rows["finger"] == finger
            names = [name for name in rows.dtype.names or () if name not in ("finger", "seq", "t_us")]
            fields = {name: np.ascontiguousarray(rows[of_finger][name]) for name in names}
            out[kind, finger] = fields | {name: values[of_finger] for name, values in counters.items()}
    return out


def _messages() -> dict[str, Any]:
    """Message classes by kind, with the wire's fields: unsigned as varint, signed as zigzag, arrays packed."""
    file = descriptor_pb2.FileDescriptorProto(name="biotac_bench.proto", package="biotac_bench", syntax="proto3")
    for kind, message_id in _OF_KIND.items():
        message = file.message_type.add(name=kind.capitalize())
        dtype = DTYPES[message_id]
        for number, name in enumerate(dtype.names or (), 1):
            base, shape = dtype[name].base, dtype[name].shape
            signed = base.kind == "i"
            kind_of = _FIELD.TYPE_SINT32 if signed else _FIELD.TYPE_UINT64
            label = _FIELD.LABEL_REPEATED if shape else _FIELD.LABEL_OPTIONAL
            message.field.add(name=name, number=number, type=kind_of, label=label)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return {
        kind: message_factory.GetMessageClass(pool.FindMessageTypeByName(f"biotac_bench.{kind.capitalize()}"))
        for kind in _OF_KIND
    }


MESSAGES = _messages()


def write(path: Path, content: Columns) -> None:
    """Write one message per frame, PAC block and heartbeat."""
    with path.open("wb") as stream, Writer(stream) as out:
        for (kind, finger), fields in content.items():
            for row in zip(*(values.tolist() for values in fields.values()), strict=True):
                message = MESSAGES[kind](finger=finger, **dict(zip(fields, row, strict=True)))
                stamp_ns = message.t_us * 1000
                out.write_message(f"/{kind}", message, stamp_ns, stamp_ns)


def load(path: Path) -> Columns:
    """All messages as arrays by finger, through one flat list per field."""
    columns: dict[tuple[str, int], dict[str, list[Any]]] = {}
    plans = {kind: _plan(kind) for kind in _OF_KIND}
    with path.open("rb") as stream:
        for _, channel, record in make_reader(stream).iter_messages(log_time_order=False):
            kind = channel.topic[1:]
            message = MESSAGES[kind].FromString(record.data)
            single, repeated = plans[kind]
            lists = columns.get((kind, message.finger))
            if lists is None:
                lists = columns[kind, message.finger] = {name: [] for name in (*single, *repeated)}
            for name in single:
                lists[name].append(getattr(message, name))
            for name in repeated:
                lists[name].extend(getattr(message, name))
    return {
        (kind, finger): {name: _array(kind, name, values) for name, values in lists.items()}
        for (kind, finger), lists in columns.items()
    }


def _plan(kind: str) -> tuple[list[str], list[str]]:
    """Fields with one value and those with several, without the finger's number."""
    dtype = DTYPES[_OF_KIND[kind]]
    names = [name for name in dtype.names or () if name != "finger"]
    return [n for n in names if not dtype[n].shape], [n for n in names if dtype[n].shape]


def _array(kind: str, name: str, values: list[Any]) -> NDArray[Any]:
    of_wire = DTYPES[_OF_KIND[kind]][name]
    dtype = np.dtype(np.int64) if name in ("seq", "t_us") else of_wire.base
    return np.array(values, dtype).reshape(-1, *of_wire.shape)
