"""Parquet: flat columns of all fingers, units and meanings as the fields' metadata."""

from __future__ import annotations

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from ..recording.reader import Recording
from .columns import Show, Table

PAC_APART = True


def write(place: Path, made: list[Table], recording: Recording, show: Show) -> None:
    """A row group a finger; ``frame_id`` is dictionary-encoded text."""
    fields = [
        pa.field("finger", pa.uint8(), metadata={"unit": "1", "what": "chip select index"}),
        pa.field("frame_id", pa.dictionary(pa.int8(), pa.string()), metadata={"what": "coordinate frame of vectors"}),
    ]
    for name, column, values in made[0].flat():
        fields.append(
            pa.field(name, pa.from_numpy_dtype(values.dtype), metadata={"unit": column.unit, "what": column.what})
        )
    schema = pa.schema(fields, metadata={f"biotac.{key}": value for key, value in recording.metadata.items()})
    with pq.ParquetWriter(place, schema, compression="zstd") as out:
        for k, table in enumerate(made):
            columns = [pa.array([table.finger] * len(table), pa.uint8())]
            columns.append(pa.array([table.frame_id] * len(table)).dictionary_encode().cast(schema.types[1]))
            columns += [pa.array(values.copy()) for _, _, values in table.flat()]
            out.write_table(pa.Table.from_arrays(columns, schema=schema))
            show((k + 1) / len(made))
