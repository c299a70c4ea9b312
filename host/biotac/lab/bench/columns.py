"""A recording's integers by finger and column, and how small they could be: what contestants must give back."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...recording.reader import Recording
from ...wire.frames import StructArray

KINDS = ("frames", "pac", "idle")

Fields = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Columns:
    """By finger, by field, arrays (n,) or (n, parts) of the wire's integers; ``seq`` and ``t_us`` int64, unwrapped."""

    frames: dict[int, Fields] = field(default_factory=dict)
    pac: dict[int, Fields] = field(default_factory=dict)
    idle: dict[int, Fields] = field(default_factory=dict)


def columns_of(recording: Recording) -> Columns:
    """The columns of a recording."""
    out = Columns()
    for finger in recording.fingers:
        mine = recording.wire["finger"] == finger
        fields = _fields(recording.wire[mine]) | {"seq": recording.seq[mine], "t_us": recording.t_us[mine]}
        for kind, rows in (("pac", recording.pac), ("idle", recording.idle)):
            own = rows[rows["finger"] == finger]
            if len(own):
                getattr(out, kind)[finger] = _fields(own) | _counters(own)
        if mine.any():
            out.frames[finger] = fields
    return out


def _fields(rows: StructArray) -> Fields:
    names = rows.dtype.names or ()
    return {name: np.ascontiguousarray(rows[name]) for name in names if name not in ("finger", "seq", "t_us")}


def _counters(rows: StructArray) -> Fields:
    return {name: rows[name].astype(np.int64) for name in ("seq", "t_us")}


def floor_bits(content: Columns) -> float:
    """Order-0 entropy of all columns, each as values or as differences."""
    bits = 0.0
    for kind in KINDS:
        for fields in getattr(content, kind).values():
            for name, values in fields.items():
                columns = series(kind, name, values)
                bits += sum(min(entropy_bits(c), entropy_bits(np.diff(c))) for c in columns if len(c) > 1)
    return bits


def series(kind: str, name: str, values: NDArray[Any]) -> NDArray[Any]:
    """The columns (c, m) that a code sees: a field's own, but PAC's 22 samples are one signal of 2200 Hz."""
    if values.ndim == 1 or (kind, name) == ("pac", "pac"):
        return values.reshape(1, -1)
    return np.ascontiguousarray(values.T)


def entropy_bits(values: NDArray[Any]) -> float:
    """Order-0 entropy of ``values``, in bits for all of them together."""
    _, counts = np.unique(values, return_counts=True)
    return float(-(counts * np.log2(counts / len(values))).sum())


def check_same(got: Columns, expected: Columns, name: str) -> None:
    """A reader that gives other arrays is no contestant."""
    for kind in KINDS:
        for finger, fields in getattr(expected, kind).items():
            for column, values in fields.items():
                if not np.array_equal(getattr(got, kind)[finger][column], values):
                    raise AssertionError(f"{name}: finger {finger} {kind}/{column} differs")
