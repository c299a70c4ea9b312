"""CSV: a header line, then the rows of all fingers in order of time.

Texts stand last and are quoted: Octave's csvread knows no quotes, so that a comma in one moves no number.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..recording.reader import Recording
from .columns import Show, Table, in_order

KINDS_APART = True
_ROWS = 10_000


def write(path: Path, made: list[Table], recording: Recording, show: Show) -> None:
    """Write the file, with numbers in their shortest exact form and NaN as ``NaN``, which Polars knows, too."""
    columns = [(name, values.dtype.kind == "U") for name, _, values in made[0].flat()]
    numbers, texts = ([name for name, is_text in columns if is_text == kind] for kind in (False, True))
    of_table, order = in_order(made)
    row_of = np.concatenate([np.arange(len(table)) for table in made])
    with path.open("w", newline="", encoding="utf-8") as file:
        file.write(",".join(["finger", *numbers, "frame_id", *texts]) + "\n")
        for begin in range(0, len(order), _ROWS):
            rows = _rows(made, of_table, row_of, order[begin : begin + _ROWS])
            file.writelines(",".join(map(str, row)) + "\n" for row in rows)
            show(begin / len(order))


def _rows(made: list[Table], of_table: Any, row_of: Any, chosen: Any) -> list[list[Any]]:
    out: list[list[Any]] = [[]] * len(chosen)
    for k, table in enumerate(made):
        at = np.flatnonzero(of_table[chosen] == k)
        rows = row_of[chosen[at]]
        flat = [values for _, _, values in table.flat()]
        numbers = [_cells(values[rows]) for values in flat if values.dtype.kind != "U"]
        texts = [_quoted(values[rows]) for values in flat if values.dtype.kind == "U"]
        texts = [_quoted([table.frame_id or ""] * len(rows)), *texts]
        finger = "" if table.finger is None else table.finger
        for row, *values in zip(at.tolist(), *numbers, *texts, strict=True):
            out[row] = [finger, *values]
    return out


def _quoted(texts: Any) -> list[str]:
    return ['"' + text.replace('"', '""') + '"' if text else "" for text in texts]


def _cells(values: Any) -> list[Any]:
    cells: list[Any] = values.tolist()
    for k in np.flatnonzero(values != values):  # NaN alone is not itself
        cells[k] = "NaN"
    return cells
