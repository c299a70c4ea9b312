"""CSV: a header line, then the rows of all fingers in order of time."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

from ..recording.reader import Recording
from .columns import Show, Table, in_order

KINDS_APART = True
_ROWS = 10_000


def write(path: Path, made: list[Table], recording: Recording, show: Show) -> None:
    """Write the file, with numbers in their shortest exact form and NaN as ``NaN``, which Polars knows, too."""
    names = ["finger", "frame_id", *(name for name, _, _ in made[0].flat())]
    of_table, order = in_order(made)
    row_of = np.concatenate([np.arange(len(table)) for table in made])
    with path.open("w", newline="", encoding="utf-8") as file:
        out = csv.writer(file, lineterminator="\n")
        out.writerow(names)
        for begin in range(0, len(order), _ROWS):
            out.writerows(_rows(made, of_table, row_of, order[begin : begin + _ROWS]))
            show(begin / len(order))


def _rows(made: list[Table], of_table: Any, row_of: Any, chosen: Any) -> list[list[Any]]:
    out: list[list[Any]] = [[]] * len(chosen)
    for k, table in enumerate(made):
        at = np.flatnonzero(of_table[chosen] == k)
        rows = row_of[chosen[at]]
        columns = [_cells(values[rows]) for _, _, values in table.flat()]
        for row, values in zip(at.tolist(), zip(*columns, strict=True), strict=True):
            out[row] = [table.finger, table.frame_id, *values]
    return out


def _cells(values: Any) -> list[Any]:
    cells: list[Any] = values.tolist()
    for k in np.flatnonzero(values != values):  # NaN alone is not itself
        cells[k] = "NaN"
    return cells
