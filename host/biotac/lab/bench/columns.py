"""A recording's integers by finger and column: what contestants must give back, and how small they could be."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...recording.reader import Recording
from ...wire.frames import StructArray

#: Arrays (n,) or (n, parts) of the wire's integers by field; ``seq`` and ``t_us`` are int64, unwrapped.
Fields = dict[str, NDArray[Any]]
#: By kind and finger.
Columns = dict[tuple[str, int], Fields]


def columns_of(recording: Recording) -> Columns:
    """The columns of a recording."""
    out: Columns = {}
    unwrapped = {"seq": recording.seq, "t_us": recording.t_us}
    for kind, rows in (("frames", recording.wire), ("pac", recording.pac), ("idle", recording.idle)):
        counters = unwrapped if kind == "frames" else {name: rows[name].astype(np.int64) for name in unwrapped}
        for finger in np.unique(rows["finger"]).tolist():
            mine = rows["finger"] == finger
            out[kind, finger] = _fields(rows[mine]) | {name: its[mine] for name, its in counters.items()}
    return out


def _fields(rows: StructArray) -> Fields:
    names = rows.dtype.names or ()
    return {name: np.ascontiguousarray(rows[name]) for name in names if name not in ("finger", "seq", "t_us")}


def floor_bits(content: Columns) -> float:
    """Order-0 entropy of all columns, each as values or as differences."""
    bits = 0.0
    for (kind, _), fields in content.items():
        for name, values in fields.items():
            columns = series(kind, name, values)
            bits += sum(min(entropy_bits(c), entropy_bits(np.diff(c))) for c in columns if len(c) > 1)
    return bits


def series(kind: str, name: str, values: NDArray[Any]) -> NDArray[Any]:
    """The columns (c, m) to encode: one per part of a field, except that PAC's 22 samples are one 2200 Hz signal."""
    if values.ndim == 1 or (kind, name) == ("pac", "pac"):
        return values.reshape(1, -1)
    return np.ascontiguousarray(values.T)


def entropy_bits(values: NDArray[Any]) -> float:
    """Order-0 entropy of ``values``, in bits for all values together."""
    _, counts = np.unique(values, return_counts=True)
    return float(-(counts * np.log2(counts / len(values))).sum())


def check_same(got: Columns, expected: Columns, name: str) -> None:
    """Raises AssertionError if a reader gives other arrays: it is no contestant."""
    for (kind, finger), fields in expected.items():
        for column, values in fields.items():
            if not np.array_equal(got[kind, finger][column], values):
                raise AssertionError(f"{name}: finger {finger} {kind}/{column} differs")
