"""The columns of every export: the rows' own fields (wire/fields.py) and a stamp on the host's clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..recording.layout import frame_id
from ..recording.reader import Recording
from ..wire.fields import AXES, BANDS_FIELDS, FRAME_FIELDS, PAC_FIELDS, Field
from ..wire.frames import StructArray

#: Called with the share of the work done, 0 to 1.
Show = Callable[[float], None]

STAMP = Field(
    "stamp_ns", "<i8", "ns", "device time on the host's clock (Unix), corrected for the drift seen in the recording"
)

GAP = Field(
    "gap_s", "<f4", "s", "how long the board or this finger was away just before this row; 0 where it was there"
)

APPLIED = Field("applied_n", "<f8", "N", "force on a simulated finger; NaN where it is not known", AXES)

LABEL = Field("label", "U", "1", "texts of the labels that hold at this row, joined by '; '; empty without any")


def _stamped(fields: Sequence[Field]) -> tuple[Field, ...]:
    """A table's columns: without the finger, as a table is one finger's, and with stamps after the times."""
    _, seq, t_us, *rest = fields
    return (seq, t_us, STAMP, *rest)


#: One row per finger and round of 10 ms.
COLUMNS = (*_stamped(FRAME_FIELDS), GAP, LABEL)
#: One row per finger and round: 22 samples, the k-th (from 0) k/2200 s after t_us.
PAC_COLUMNS = _stamped(PAC_FIELDS)
#: One row per finger and round: a spectrogram of PAC, in octaves.
BANDS_COLUMNS = _stamped(BANDS_FIELDS)

#: Tables in every export.
EXPORTED: Mapping[str, tuple[Field, ...]] = {"frames": COLUMNS, "pac": PAC_COLUMNS, "bands": BANDS_COLUMNS}


@dataclass(frozen=True)
class Table:
    """One finger's rows of one kind, such as ``frames``, ``pac`` or ``bands``.

    ``arrays`` are (n,) or (n, parts), by column name. ``finger`` is None for rows of the board itself. ``frame``: the
    name of the coordinate frame, where it is not ours.
    """

    kind: str
    finger: int | None
    columns: tuple[Field, ...]
    arrays: dict[str, NDArray[Any]]
    frame: str | None = None

    @property
    def frame_id(self) -> str | None:
        """The vectors' coordinate frame."""
        return self.frame or (None if self.finger is None else frame_id(self.finger))

    def __len__(self) -> int:
        return len(self.arrays["t_us"])

    def flat(self) -> Iterator[tuple[str, Field, NDArray[Any]]]:
        """Scalar columns (n,), with vectors split up: ``force_x_n`` from force_n, ``counts_E1`` from counts."""
        for column in self.columns:
            values = self.arrays[column.name]
            if not column.parts:
                yield column.name, column, values
            for k, name in enumerate(column.flat_names() if column.parts else ()):
                yield name, column, values[:, k]


def in_order(made: list[Table]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The rows of tables that stand one after the other: each row's table, and their order by time, then table."""
    of_table = np.repeat(np.arange(len(made)), [len(table) for table in made])
    return of_table, np.lexsort((of_table, np.concatenate([table.arrays["t_us"] for table in made])))


def described(made: list[Table]) -> dict[str, tuple[Field, ...]]:
    """The columns of each kind in ``made``, and of those that are exported."""
    return {**EXPORTED, **{table.kind: table.columns for table in made}}


def tables(recording: Recording, *, applied: bool = True) -> list[Table]:
    """Tables of each kind for every finger that has such rows, ordered by finger.

    With ``applied``, frames of simulated fingers have APPLIED, too.
    """
    made = []
    kinds = EXPORTED
    if applied and recording.applied_n is not None:
        kinds = {**EXPORTED, "frames": (*COLUMNS, APPLIED)}
    for finger in recording.fingers:
        for kind, columns in kinds.items():
            rows: StructArray = getattr(recording, kind)
            of_finger = rows[rows["finger"] == finger]
            if len(of_finger):
                made.append(Table(kind, finger, columns, _arrays(recording, columns, of_finger)))
    return made


def turned(table: Table, turn: NDArray[np.float64] | None) -> Table:
    """The table with all vectors turned by (3, 3)."""
    vectors = [column for column in table.columns if column.parts == AXES and turn is not None]
    made = {c.name: (table.arrays[c.name] @ np.transpose(turn)).astype(c.dtype) for c in vectors}  # type: ignore[arg-type]
    return replace(table, arrays=table.arrays | made)


def _arrays(recording: Recording, columns: Sequence[Field], rows: StructArray) -> dict[str, NDArray[Any]]:
    made: dict[str, Callable[[], NDArray[Any]]] = {
        STAMP.name: lambda: recording.stamp_ns(rows["t_us"]),
        GAP.name: lambda: recording.gap_s_at(rows),
        APPLIED.name: lambda: recording.applied_at(rows["finger"], rows["t_us"]),
        LABEL.name: lambda: recording.labels_at(rows),
    }
    return {column.name: made[column.name]() if column.name in made else rows[column.name] for column in columns}
