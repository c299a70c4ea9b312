"""JSON messages beside the wire, for Foxglove and PlotJuggler: SI units, a frame_id, fewer than the wire has.

The wire is the truth; these are derived from it, thinned so that a long recording stays small, and no
reader of ours looks at them. A value that is invalid is left out, and is null in a list: JSON has no NaN. (The schemas
name a list's type alone, as these tools know no union types.)
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from mcap.writer import Writer

from ..wire import messages_gen as wire
from ..wire.batches import Batch, StreamDecoder
from ..wire.frames import StructArray
from . import layout
from .stamps import Stamps

RESULTS_US = 40_000  # 25 a second
COUNTS_US = 200_000  # 5 a second
_NO_TARE = 0xFFFFFFFF


def _number(what: str) -> dict[str, Any]:
    return {"type": "number", "description": what}


def _vector(what: str) -> dict[str, Any]:
    return {"type": "object", "description": what, "properties": {axis: {"type": "number"} for axis in "xyz"}}


_HEAD = {
    "timestamp": {
        "type": "object",
        "description": "device time on the host's clock (Unix)",
        "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}},
    },
    "frame_id": {"type": "string"},
    "seq": {"type": "integer", "description": "of the FRAME in /biotac/wire"},
}
RESULTS_SCHEMA = {
    "title": "biotac.Results",
    "type": "object",
    "description": "x to the tip, y to E11's side, z dorsal; force and torque act on the finger",
    "properties": _HEAD
    | {
        "force_n": _vector("N"),
        "torque_nm": _vector("N*m, about the origin; x is derived"),
        "poc_m": _vector("m, point of contact"),
        "pressure_force_n": _number("magnitude of the force from static pressure, N; left out unless calibrated"),
        "torsion_nm": _number(
            "torque about the outward normal at the contact, N*m; left out unless a wrench map has it"
        ),
        "contact": {"type": "boolean"},
        "flags": {"type": "integer", "description": "flags frame in MESSAGES.md"},
    },
}
COUNTS_SCHEMA = {
    "title": "biotac.Counts",
    "type": "object",
    "properties": _HEAD
    | {
        "electrodes": {"type": "array", "items": {"type": "integer"}, "description": "E1..E19; null where missing"},
        "pdc": _number("static pressure, count"),
        "tac": _number("thermal flux, count"),
        "tdc": _number("temperature, count"),
        "pac": {
            "type": "array",
            "items": {"type": "integer"},
            "description": "22 samples, 1/2200 s apart, count; null where missing",
        },
    },
}
TARE_SCHEMA = {
    "title": "biotac.Tare",
    "type": "object",
    "properties": _HEAD
    | {
        "reason": {"type": "string", "description": "enum tare_reason in MESSAGES.md"},
        "state": {"type": "string", "description": "enum tare_state in MESSAGES.md"},
        "tare": {"type": "array", "items": {"type": "number"}, "description": "E1..E19, count; null where unknown"},
    },
}
_TOPICS = {"results": RESULTS_SCHEMA, "counts": COUNTS_SCHEMA, "tare": TARE_SCHEMA}


@dataclass(frozen=True)
class _Message:
    """One to be written; ``body`` still without its head."""

    topic: str
    finger: int
    t_us: int
    seq: int
    body: dict[str, Any]


class Plots:
    """Writes the messages of all fingers; a finger's topics appear with its first message."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._stamps: Stamps | None = None
        self._channels: dict[tuple[str, int], int] = {}
        self._schemas: dict[str, int] = {}
        self._due_us: dict[tuple[str, int], int] = {}

    def add(self, batch: Batch, decoder: StreamDecoder, arrived_ns: int, all_here_ns: int | None) -> bool:
        """Write what the next rows are good for; true if that was anything.

        ``decoder`` is theirs; their first byte was here at ``arrived_ns``, all at ``all_here_ns`` if anybody knows.
        """
        begin_us, end_us = batch.first_t_us(), batch.last_t_us()
        if self._stamps is None and begin_us is not None:
            self._stamps = Stamps(begin_us, arrived_ns)
        if self._stamps is None:
            return False
        if end_us is not None and all_here_ns is not None:
            self._stamps.arrived(end_us, all_here_ns)
        messages = [*self._results(batch), *self._counts(batch)]
        messages += [
            _Message("tare", tare.finger, decoder.unwrap_t_us(tare.t_us), tare.seq, tare_change(tare))
            for tare in batch.messages
            if isinstance(tare, wire.Tare)
        ]
        messages.sort(key=lambda message: message.t_us)
        stamps = self._stamps(np.array([message.t_us for message in messages], np.int64))
        for message, stamp_ns in zip(messages, np.maximum(stamps, 0).tolist(), strict=True):
            head = {
                "timestamp": {"sec": stamp_ns // 10**9, "nsec": stamp_ns % 10**9},
                "frame_id": layout.frame_id(message.finger),
                "seq": message.seq,
            }
            data = json.dumps(head | message.body, separators=(",", ":")).encode()
            channel = self._channel(message.topic, message.finger)
            self._writer.add_message(channel, stamp_ns, data, stamp_ns, message.seq)
        return bool(messages)

    def _results(self, batch: Batch) -> Iterator[_Message]:
        for k in self._thinned("results", batch.frames):
            yield _of_row("results", batch.frames[k], results(batch.wire[k]))

    def _counts(self, batch: Batch) -> Iterator[_Message]:
        pac = {(int(row["finger"]), int(row["seq"])): row["pac"] for row in batch.pac[self._thinned("pac", batch.pac)]}
        for k in self._thinned("counts", batch.frames):
            row = batch.frames[k]
            block = pac.get((int(row["finger"]), int(row["seq"])))
            yield _of_row("counts", row, counts(row) | ({} if block is None else {"pac": _count_list(block)}))

    def _thinned(self, what: str, rows: StructArray) -> list[int]:
        """Rows to show: of each finger the first of every period of device time."""
        period_us = RESULTS_US if what == "results" else COUNTS_US
        chosen: list[int] = []
        for finger in np.unique(rows["finger"]):
            mine = np.flatnonzero(rows["finger"] == finger)
            slot = rows["t_us"][mine] // period_us
            fresh = np.diff(slot, prepend=self._due_us.get((what, int(finger)), -1)) != 0
            self._due_us[what, int(finger)] = int(slot[-1])
            chosen += mine[fresh].tolist()
        return chosen

    def _channel(self, topic: str, finger: int) -> int:
        if topic not in self._schemas:
            schema = _TOPICS[topic]
            data = json.dumps(schema).encode()
            self._schemas[topic] = self._writer.register_schema(str(schema["title"]), "jsonschema", data)
        if (topic, finger) not in self._channels:
            name = f"/biotac/finger{finger}/{topic}"
            self._channels[topic, finger] = self._writer.register_channel(name, "json", self._schemas[topic])
        return self._channels[topic, finger]


def results(row: Any) -> dict[str, Any]:
    """What one FRAME message says of a contact, SI, invalid values left out."""
    body: dict[str, Any] = {}
    for name, field, per_unit, invalid in (
        ("force_n", "force_100un", 10_000, wire.INVALID_I32),
        ("torque_nm", "torque_mnmm", 1_000_000, wire.INVALID_I32),
        ("poc_m", "poc_um", 1_000_000, wire.INVALID_I16),
    ):
        values = {
            axis: value / per_unit for axis, value in zip("xyz", row[field].tolist(), strict=True) if value != invalid
        }
        if values:
            body[name] = values
    if row["pressure_force_100un"] != wire.INVALID_I32:
        body["pressure_force_n"] = int(row["pressure_force_100un"]) / 10_000
    if row["torsion_mnmm"] != wire.INVALID_I32:
        body["torsion_nm"] = int(row["torsion_mnmm"]) / 1_000_000
    flags = int(row["flags"])
    return body | {"contact": bool(flags & wire.FrameFlags.CONTACT), "flags": flags}


def counts(row: Any) -> dict[str, Any]:
    """Raw counts of one frame, missing electrodes null, missing slow channels left out."""
    slow = {name: int(row[name]) for name in ("pdc", "tac", "tdc") if row[name] != wire.INVALID_COUNT}
    return {"electrodes": _count_list(row["counts"])} | slow


def tare_change(tare: wire.Tare) -> dict[str, Any]:
    """What a TARE message says, electrodes without a tare null."""
    return {
        "reason": _name(wire.TareReason, tare.reason),
        "state": _name(wire.TareState, tare.tare_state),
        "tare": [None if value == _NO_TARE else round(value / 65536, 4) for value in tare.tare_q16],
    }


def _count_list(values: Any) -> list[int | None]:
    return [None if value == wire.INVALID_COUNT else value for value in values.tolist()]


def _of_row(topic: str, row: Any, body: dict[str, Any]) -> _Message:
    return _Message(topic, int(row["finger"]), int(row["t_us"]), int(row["seq"]), body)


def _name(kind: Any, value: int) -> str:
    return str(kind(value).name) if value in list(kind) else str(value)
