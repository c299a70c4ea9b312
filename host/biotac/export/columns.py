"""What every export holds: the rows' own fields (wire/fields.py) and a stamp on the host's clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from ..recording.layout import frame_id
from ..recording.reader import Recording
from ..wire.fields import FRAME_FIELDS, PAC_FIELDS, Field
from ..wire.frames import StructArray

#: Told a share 0..1 of the work that is done.
Show = Callable[[float], None]

STAMP = Field("stamp_ns", "<i8", "ns", "device time on the host's clock (Unix), by the drift that the recording shows")


def _stamped(fields: Sequence[Field]) -> tuple[Field, ...]:
    """A table is one finger's, and has stamps behind its times."""
    _, seq, t_us, *rest = fields
    return (seq, t_us, STAMP, *rest)


#: One row a finger and round of 10 ms.
COLUMNS = _stamped(FRAME_FIELDS)
#: One row a finger and round: 22 samples, the k-th k/2200 s after t_us.
PAC_COLUMNS = _stamped(PAC_FIELDS)


@dataclass(frozen=True)
class Table:
    """One finger's rows of one kind (``frames`` or ``pac``); arrays (n,) or (n, parts) by column name."""

    kind: str
    finger: int
    columns: tuple[Field, ...]
    arrays: dict[str, NDArray[Any]]

    @property
    def frame_id(self) -> str:
        """The coordinate frame of its vectors."""
        return frame_id(self.finger)

    def __len__(self) -> int:
        return len(self.arrays["seq"])

    def flat(self) -> Iterator[tuple[str, Field, NDArray[Any]]]:
        """Scalar columns (n,), vectors taken apart: ``force_x_n`` of force_n, ``counts_E1`` of counts."""
        for column in self.columns:
            values = self.arrays[column.name]
            if not column.parts:
                yield column.name, column, values
            for k, name in enumerate(column.flat_names() if column.parts else ()):
                yield name, column, values[:, k]


def tables(recording: Recording) -> list[Table]:
    """Frames and PAC of every finger that has any, in the fingers' order."""
    made = []
    for finger in recording.fingers:
        for kind, columns, rows in (
            ("frames", COLUMNS, recording.frames),
            ("pac", PAC_COLUMNS, recording.pac),
        ):
            mine = rows[rows["finger"] == finger]
            if len(mine):
                made.append(Table(kind, finger, columns, _arrays(recording, columns, mine)))
    return made


def _arrays(recording: Recording, columns: Sequence[Field], rows: StructArray) -> dict[str, NDArray[Any]]:
    stamps = recording.stamp_ns(rows["t_us"])
    return {column.name: stamps if column is STAMP else rows[column.name] for column in columns}
