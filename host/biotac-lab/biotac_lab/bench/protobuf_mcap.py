"""A contestant: the same content as one protobuf message per frame, in MCAP with the library's default settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader
from mcap_protobuf.writer import Writer
from numpy.typing import NDArray

_FIELD = descriptor_pb2.FieldDescriptorProto
Content = dict[str, NDArray[Any]]  # rows by kind


def _message_classes(content: Content) -> dict[str, Any]:
    """By kind, with the rows' fields: unsigned as varint, signed as zigzag, arrays packed."""
    file = descriptor_pb2.FileDescriptorProto(name="biotac_bench.proto", package="biotac_bench", syntax="proto3")
    for kind, rows in content.items():
        message = file.message_type.add(name=kind)
        for number, name in enumerate(rows.dtype.names or (), 1):
            field = rows.dtype[name]
            kind_of = _FIELD.TYPE_SINT64 if field.base.kind == "i" else _FIELD.TYPE_UINT64
            label = _FIELD.LABEL_REPEATED if field.shape else _FIELD.LABEL_OPTIONAL
            message.field.add(name=name, number=number, type=kind_of, label=label)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return {
        kind: message_factory.GetMessageClass(pool.FindMessageTypeByName(f"biotac_bench.{kind}")) for kind in content
    }


class ProtobufMcap:
    """A file of one message for each row of ``content``, written and read."""

    def __init__(self, path: Path, content: Content) -> None:
        self._path, self._classes = path, _message_classes(content)
        self._fields = {
            kind: {name: rows.dtype[name] for name in rows.dtype.names or ()} for kind, rows in content.items()
        }
        with path.open("wb") as stream, Writer(stream) as out:
            for kind, rows in content.items():
                for row in zip(*(rows[name].tolist() for name in self._fields[kind]), strict=True):
                    message = self._classes[kind](**dict(zip(self._fields[kind], row, strict=True)))
                    stamp_ns = message.t_us * 1000
                    out.write_message(f"/{kind}", message, stamp_ns, stamp_ns)

    def load(self) -> dict[str, dict[str, NDArray[Any]]]:
        """All messages as arrays by kind and field, through one flat list per field."""
        flat: dict[str, dict[str, list[Any]]] = {kind: {name: [] for name in own} for kind, own in self._fields.items()}
        single, repeated = (
            {kind: [(name, flat[kind][name]) for name, field in own.items() if bool(field.shape) == arrays]
             for kind, own in self._fields.items()}
            for arrays in (False, True)
        )  # fmt: skip
        with self._path.open("rb") as stream:
            for _, channel, record in make_reader(stream).iter_messages(log_time_order=False):
                kind = channel.topic[1:]
                message = self._classes[kind].FromString(record.data)
                for name, values in single[kind]:
                    values.append(getattr(message, name))
                for name, values in repeated[kind]:
                    values.extend(getattr(message, name))
        return {
            kind: {
                name: np.array(flat[kind][name], field.base).reshape(-1, *field.shape) for name, field in own.items()
            }
            for kind, own in self._fields.items()
        }
