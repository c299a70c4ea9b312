"""Timed messages that are not rows (TARE, STATUS and so on), as tables of the wire's integers; the tare's trace."""

from __future__ import annotations

import json
from collections import defaultdict
from functools import cache

import numpy as np

from ..recording.reader import Recording
from ..recording.stamps import unwrapped_us
from ..recording.trace import TRACE, trace
from ..wire import messages_gen as wire
from ..wire.dtypes_gen import DTYPES
from ..wire.fields import Field
from ..wire.native import BUILT
from ..wire.sensor_gen import ELECTRODE_NAMES
from .columns import STAMP, Table

_T_US = Field("t_us", "<i8", "us", "device time, unwrapped from the first value seen")
_ELSEWHERE = ("seq", "t_us", "req_id", "finger")  # fields of a message that its table leaves out or has in another form


def message_tables(recording: Recording) -> list[Table]:
    """One table per kind of message and finger; its kind is the message's name in lower case. BANDS are rows."""
    timed = [m for m in recording.messages if "t_us" in (DTYPES[m.ID].names or ()) and not isinstance(m, wire.Bands)]
    t_us = unwrapped_us(recording.begin_us, [m.t_us for m in timed])
    groups: dict[tuple[int, int | None], list[int]] = defaultdict(list)
    for k, message in enumerate(timed):
        groups[message.ID, getattr(message, "finger", None)].append(k)
    made = []
    for (message_id, finger), at in sorted(groups.items(), key=lambda group: (group[0][0], group[0][1] or 0)):
        rows = np.frombuffer(b"".join(timed[k].pack() for k in at), DTYPES[message_id])
        kind, fields = _described(message_id)
        arrays = {"t_us": t_us[at], STAMP.name: recording.stamp_ns(t_us[at])}
        arrays |= {field.name: rows[field.name] for field in fields}
        made.append(Table(kind, finger, (_T_US, STAMP, *fields), arrays))
    return made


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


@cache
def _described(message_id: int) -> tuple[str, tuple[Field, ...]]:
    """A message's name, and its fields with their units and meanings from protocol/link.toml."""
    messages = json.loads((BUILT / "schema.json").read_text(encoding="utf-8"))["link"]["message"]
    kind, entry = next((name.lower(), entry) for name, entry in messages.items() if entry["id"] == message_id)
    described = {field["name"]: field for field in entry["fields"]}
    dtype = DTYPES[message_id]
    made = []
    for name in dtype.names or ():
        if name in _ELSEWHERE:
            continue
        base, shape = dtype[name].base, dtype[name].shape
        count = shape[0] if shape else 0
        parts = tuple(ELECTRODE_NAMES) if count == len(ELECTRODE_NAMES) else tuple(str(k) for k in range(count))
        about = described[name]
        # In these messages, all ones means "no value" where the field's text in link.toml says so.
        ones = int(np.iinfo(base).max)
        invalid = ones if f"0x{ones:X} " in about["doc"] else None
        made.append(Field(name, base.str, about["unit"], about["doc"], parts, invalid=invalid))
    return kind, tuple(made)
