"""Parquet: flat columns of all fingers, units and meanings as the fields' metadata."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ..recording.layout import frame_id
from ..recording.reader import Recording
from .columns import Show, Table

PAC_APART = True


_ROWS = 1 << 17  # in memory at once


def write(place: Path, made: list[Table], recording: Recording, show: Show) -> None:
    """All fingers in the order of time, sorted by t_us and finger; null where there is no value.

    Integers are delta-encoded, which is what makes zstd small; ``frame_id`` is dictionary-encoded text.
    """
    order = np.lexsort((_finger_of(made), np.concatenate([table.arrays["t_us"] for table in made])))
    fields = [
        pa.field("finger", pa.uint8(), metadata={"unit": "1", "what": "chip select index"}),
        pa.field("frame_id", pa.dictionary(pa.int8(), pa.string()), metadata={"what": "coordinate frame of vectors"}),
    ]
    for name, column, values in made[0].flat():
        fields.append(
            pa.field(name, pa.from_numpy_dtype(values.dtype), metadata={"unit": column.unit, "what": column.what})
        )
    schema = pa.schema(fields, metadata={f"biotac.{key}": value for key, value in recording.metadata.items()})
    with pq.ParquetWriter(
        place,
        schema,
        compression="zstd",
        use_dictionary=["frame_id", *(f.name for f in fields if pa.types.is_floating(f.type))],
        column_encoding={f.name: "DELTA_BINARY_PACKED" for f in fields if pa.types.is_integer(f.type)},
        sorting_columns=pq.SortingColumn.from_ordering(schema, [("t_us", "ascending"), ("finger", "ascending")]),
    ) as out:
        for begin in range(0, len(order), _ROWS):
            chosen = order[begin : begin + _ROWS]
            out.write_table(pa.Table.from_arrays(list(_columns(made, chosen, schema)), schema=schema))
            show(begin / len(order))


def _finger_of(made: list[Table]) -> NDArray[np.uint8]:
    return np.repeat(np.array([table.finger for table in made], np.uint8), [len(table) for table in made])


def _columns(made: list[Table], chosen: NDArray[Any], schema: pa.Schema) -> Iterator[pa.Array]:
    fingers = _finger_of(made)[chosen]
    yield pa.array(fingers)
    yield pa.array([frame_id(finger) for finger in fingers.tolist()]).dictionary_encode().cast(schema.types[1])
    for parts in zip(*(table.flat() for table in made), strict=True):
        column = parts[0][1]
        values = np.concatenate([values for _, _, values in parts])[chosen]
        missing = np.isnan(values) if values.dtype.kind == "f" else values == column.invalid
        yield pa.array(values, mask=np.broadcast_to(missing, values.shape))
