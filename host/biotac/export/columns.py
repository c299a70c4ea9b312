"""What every export holds: the rows' own fields (wire/fields.py) and a stamp on the host's clock."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from ..recording.layout import frame_id
from ..recording.reader import Recording
from ..wire.fields import BANDS_FIELDS, FRAME_FIELDS, IDLE_FIELDS, PAC_FIELDS, Field
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
#: One row a finger and round: a spectrogram of PAC, in octaves.
BANDS_COLUMNS = _stamped(BANDS_FIELDS)
#: One row a heartbeat of a finger that nobody touches.
IDLE_COLUMNS = _stamped(IDLE_FIELDS)

#: What the exports to one file have. A lake has heartbeats, too.
EXPORTED: Mapping[str, tuple[Field, ...]] = {"frames": COLUMNS, "pac": PAC_COLUMNS, "bands": BANDS_COLUMNS}
HEARTBEATS: Mapping[str, tuple[Field, ...]] = {"idle": IDLE_COLUMNS}


@dataclass(frozen=True)
class Table:
    """One finger's rows of one kind (``frames``, ``pac``, ``bands``); arrays (n,) or (n, parts) by column name.

    ``finger`` is None for rows that are the board's.
    """

    kind: str
    finger: int | None
    columns: tuple[Field, ...]
    arrays: dict[str, NDArray[Any]]

    @property
    def frame_id(self) -> str | None:
        """The coordinate frame of its vectors."""
        return None if self.finger is None else frame_id(self.finger)

    def __len__(self) -> int:
        return len(self.arrays["t_us"])

    def flat(self) -> Iterator[tuple[str, Field, NDArray[Any]]]:
        """Scalar columns (n,), vectors taken apart: ``force_x_n`` of force_n, ``counts_E1`` of counts."""
        for column in self.columns:
            values = self.arrays[column.name]
            if not column.parts:
                yield column.name, column, values
            for k, name in enumerate(column.flat_names() if column.parts else ()):
                yield name, column, values[:, k]


def tables(recording: Recording, kinds: Mapping[str, tuple[Field, ...]] = EXPORTED) -> list[Table]:
    """The ``kinds`` of rows of every finger that has any, in the fingers' order."""
    made = []
    for finger in recording.fingers:
        for kind, columns in kinds.items():
            rows: StructArray = getattr(recording, kind)
            mine = rows[rows["finger"] == finger]
            if len(mine):
                made.append(Table(kind, finger, columns, _arrays(recording, columns, mine)))
    return made


def _arrays(recording: Recording, columns: Sequence[Field], rows: StructArray) -> dict[str, NDArray[Any]]:
    stamps = recording.stamp_ns(rows["t_us"])
    return {column.name: stamps if column is STAMP else rows[column.name] for column in columns}
