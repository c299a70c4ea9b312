"""Numbers in the cells of CSV rows, as pandas, R, DuckDB and spreadsheets write them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

_MISSING = {"", "na", "n/a", "#n/a", "<na>", "null", "none", "nil", "missing"}


def numbers(rows: Iterable[str], delimiter: str, columns: Sequence[int]) -> NDArray[np.float64]:
    """``columns`` of rows (n,), also of quoted numbers; NaN for an empty cell and words for none.

    Lines that begin with # are comments. Raises ValueError with the row's number for anything else.
    """
    rows = [row for row in rows if "#" not in row or row.lstrip()[:1] != "#" or row.lstrip()[:4].lower() == "#n/a"]
    # NumPy would take a row that begins with #N/A for a comment.
    how: dict[str, Any] = {"delimiter": delimiter, "usecols": columns, "ndmin": 2, "quotechar": '"', "comments": None}
    try:
        out: NDArray[np.float64] = np.loadtxt(rows, **how)
    except ValueError:
        out = np.loadtxt(rows, converters=_number, encoding=None, **how)
    return out


def _number(cell: str) -> float:
    text = cell.strip().strip('"').strip()
    return float("nan") if text.lower() in _MISSING else float(text.replace("_", "?"))  # Python alone takes 1_0 for 10
