"""Numbers in the cells of CSV rows, as pandas, R, DuckDB and spreadsheets write them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

_MISSING = {"", "na", "n/a", "<na>", "null", "none", "nil", "missing"}


def numbers(rows: Iterable[str], delimiter: str, columns: Sequence[int]) -> NDArray[np.float64]:
    """``columns`` of rows (n,), also of quoted numbers; NaN for an empty cell and words for none.

    Raises ValueError with the row's number for anything else.
    """
    rows = list(rows)
    how: dict[str, Any] = {
        "delimiter": delimiter,
        "usecols": columns,
        "ndmin": 2,
        "quotechar": '"',
        "dtype": np.float64,
    }
    try:
        out: NDArray[np.float64] = np.loadtxt(rows, **how)
    except ValueError:
        rows = [row.replace("#N/A", "").replace("#n/a", "") for row in rows]  # else it begins a comment
        out = np.loadtxt(rows, converters=_number, encoding=None, **how)
    return out


def _number(cell: str) -> float:
    text = cell.strip().strip('"').strip()
    return float("nan") if text.lower() in _MISSING else float(text)
