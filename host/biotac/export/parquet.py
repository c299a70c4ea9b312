"""Parquet: flat columns of all fingers, with units and meanings as the fields' metadata."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ..recording.reader import Recording
from .columns import Show, Table, in_order

KINDS_APART = True


_ROWS = 1 << 17  # in memory at once


@dataclass(frozen=True)
class TextColumn:
    """A text column with one value for each whole table, None for no value; small because it is dictionary-encoded.

    ``texts`` holds the value for each of the tables.
    """

    name: str
    what: str
    texts: tuple[str | None, ...]


def write(path: Path, made: list[Table], recording: Recording, show: Show) -> None:
    """Write the rows of all fingers, sorted by t_us and finger; null where there is no value."""
    metadata = {f"biotac.{key}": value for key, value in recording.metadata.items()}
    write_labelled(path, made, [frame_ids(made)], metadata, show)


def frame_ids(made: list[Table]) -> TextColumn:
    return TextColumn("frame_id", "coordinate frame of vectors", tuple(table.frame_id for table in made))


def write_labelled(
    path: Path,
    made: list[Table],
    labels: list[TextColumn],
    metadata: Mapping[str, str],
    show: Show = lambda share: None,
) -> None:
    """Write the rows of tables of one kind in order of time, each row with the labels of that table.

    Integers are delta-encoded, so that zstd compresses them well.
    """
    of_table, order = in_order(made)
    fingers = None
    fields = []
    if made[0].finger is not None:
        fingers = np.array([table.finger for table in made], np.uint8)
        fields = [pa.field("finger", pa.uint8(), metadata={"unit": "1", "what": "chip select index"})]
    kind = pa.dictionary(pa.int8(), pa.string())
    fields += [pa.field(label.name, kind, metadata={"what": label.what}) for label in labels]
    for name, column, values in made[0].flat():
        about = {"unit": column.unit, "what": column.what}
        fields.append(pa.field(name, pa.from_numpy_dtype(values.dtype), metadata=about))
    schema = pa.schema(fields, metadata=dict(metadata))
    sorting = [(name, "ascending") for name in ("t_us", *(["finger"] if fingers is not None else []))]
    how = {
        "compression": "zstd",
        "write_page_checksum": True,  # for readers that check it
        "use_dictionary": [f.name for f in fields if not pa.types.is_integer(f.type)],
        "column_encoding": {f.name: "DELTA_BINARY_PACKED" for f in fields if pa.types.is_integer(f.type)},
        "sorting_columns": pq.SortingColumn.from_ordering(schema, sorting),
    }
    # Opened here: pyarrow takes no path that is not UTF-8.
    with path.open("wb") as file, pq.ParquetWriter(file, schema, **how) as out:
        for begin in range(0, len(order), _ROWS):
            chosen = order[begin : begin + _ROWS]
            columns = list(_columns(made, labels, fingers, of_table, chosen))
            out.write_table(pa.Table.from_arrays(columns, schema=schema))
            show(begin / len(order))


def _columns(
    made: list[Table], labels: list[TextColumn], fingers: NDArray[np.uint8] | None, of_table: NDArray[Any], chosen: Any
) -> Iterator[pa.Array]:
    if fingers is not None:
        yield pa.array(fingers[of_table[chosen]])
    for label in labels:
        texts = sorted({text for text in label.texts if text is not None})
        code = np.array([-1 if text is None else texts.index(text) for text in label.texts], np.int8)[of_table[chosen]]
        yield pa.DictionaryArray.from_arrays(pa.array(code, mask=code < 0), pa.array(texts, pa.string()))
    for parts in zip(*(table.flat() for table in made), strict=True):
        column = parts[0][1]
        values = np.concatenate([values for _, _, values in parts])[chosen]
        missing = np.isnan(values) if values.dtype.kind == "f" else values == column.invalid
        yield pa.array(values, mask=np.broadcast_to(missing, values.shape))
