"""The tare machine's trace as tables."""

from __future__ import annotations

from ..recording.reader import Recording
from ..recording.trace import TRACE, trace
from ..wire.fields import Field
from .columns import STAMP, Table

_T_US = Field("t_us", "<i8", "us", "device time, unwrapped from the first value seen")


def trace_tables(recording: Recording) -> list[Table]:
    """The tare machine's course: a table of kind ``trace`` by finger. Raises InputError where rounds are missing."""
    return [
        Table(
            "trace",
            finger,
            (_T_US, STAMP, *TRACE),
            {name: rows[name] for name in rows.dtype.names or ()} | {STAMP.name: recording.stamp_ns(rows["t_us"])},
        )
        for finger, rows in trace(recording).items()
    ]
