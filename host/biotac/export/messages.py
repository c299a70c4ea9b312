"""Timed messages that are not rows (TARE, STATUS and so on), as tables of the wire's integers."""

from __future__ import annotations

import json
from collections import defaultdict
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..recording.reader import Recording
from ..recording.stamps import unwrapped_us
from ..wire import messages_gen as wire
from ..wire.dtypes_gen import DTYPES
from ..wire.fields import Field
from ..wire.frames import StructArray
from ..wire.native import BUILT
from ..wire.sensor_gen import ELECTRODE_NAMES
from .columns import STAMP, Table

_T_US = Field("t_us", "<i8", "us", "device time, unwrapped from the first value seen")
_ITS_OWN = ("seq", "t_us", "req_id", "finger")  # fields of a message that its table leaves out or has in another form


def message_tables(recording: Recording) -> list[Table]:
    """One table per kind of message and finger; its kind is the message's name in lower case. BANDS are rows."""
    timed = [m for m in recording.messages if "t_us" in (DTYPES[m.ID].names or ()) and not isinstance(m, wire.Bands)]
    t_us = unwrapped_us(recording.begin_us, [m.t_us for m in timed])
    groups: dict[tuple[int, int | None], list[int]] = defaultdict(list)
    for k, message in enumerate(timed):
        groups[message.ID, getattr(message, "finger", None)].append(k)
    return [
        _table(recording, message_id, finger, [timed[k] for k in at], t_us[at])
        for (message_id, finger), at in sorted(groups.items(), key=lambda group: (group[0][0], group[0][1] or 0))
    ]


def _table(
    recording: Recording, message_id: int, finger: int | None, messages: list[Any], t_us: NDArray[np.int64]
) -> Table:
    rows: StructArray = np.concatenate([np.frombuffer(m.pack(), DTYPES[message_id]) for m in messages])
    own = _fields(message_id)
    arrays: dict[str, NDArray[Any]] = {"t_us": t_us, STAMP.name: recording.stamp_ns(t_us)}
    return Table(
        _name(message_id).lower(),
        finger,
        (_T_US, STAMP, *own),
        arrays | {field.name: rows[field.name] for field in own},
    )


def _name(message_id: int) -> str:
    return next(name for name, entry in _schema().items() if entry["id"] == message_id)


@cache
def _schema() -> dict[str, Any]:
    text = (BUILT / "schema.json").read_text(encoding="utf-8")
    messages: dict[str, Any] = json.loads(text)["link"]["message"]
    return messages


@cache
def _fields(message_id: int) -> tuple[Field, ...]:
    """A message's fields, with their units and meanings from protocol/link.toml."""
    dtype = DTYPES[message_id]
    described = {field["name"]: field for field in _schema()[_name(message_id)]["fields"]}
    made = []
    for name in dtype.names or ():
        if name in _ITS_OWN:
            continue
        base, shape = dtype[name].base, dtype[name].shape
        count = shape[0] if shape else 0
        parts = tuple(ELECTRODE_NAMES) if count == len(ELECTRODE_NAMES) else tuple(str(k) for k in range(count))
        about = described[name]
        # In these messages, all ones means "no value" where the field's text in link.toml says so.
        ones = int(np.iinfo(base).max)
        invalid = ones if f"0x{ones:X} " in about["doc"] else None
        made.append(Field(name, base.str, about["unit"], about["doc"], parts, invalid=invalid))
    return tuple(made)
