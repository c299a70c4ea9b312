"""JSON messages beside the wire, for Foxglove and PlotJuggler: SI units, a frame_id, fewer than the wire has.

The wire is the truth; these are derived from it, thinned so that a long recording stays small, and no
reader of ours looks at them. A value that is invalid is left out, as JSON has no NaN and these tools no
union types.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from mcap.writer import Writer

from ..wire import messages_gen as wire
from ..wire.batches import Batch
from ..wire.frames import StructArray
from . import layout

RESULTS_US = 40_000  # 25 a second
COUNTS_US = 200_000  # 5 a second


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
        "electrodes": {"type": "array", "items": {"type": "integer"}, "description": "E1..E19; 65535 where missing"},
        "pdc": _number("static pressure, count"),
        "tac": _number("thermal flux, count"),
        "tdc": _number("temperature, count"),
        "pac": {"type": "array", "items": {"type": "integer"}, "description": "22 samples, 1/2200 s apart, count"},
    },
}
TARE_SCHEMA = {
    "title": "biotac.Tare",
    "type": "object",
    "properties": _HEAD
    | {
        "reason": {"type": "string", "description": "enum tare_reason in MESSAGES.md"},
        "state": {"type": "string", "description": "enum tare_state in MESSAGES.md"},
        "tare": {"type": "array", "items": {"type": "number"}, "description": "E1..E19, count; -1 where unknown"},
    },
}
_TOPICS = {"results": RESULTS_SCHEMA, "counts": COUNTS_SCHEMA, "tare": TARE_SCHEMA}


@dataclass(frozen=True)
class _Anchor:
    """Where device time meets the host's clock."""

    t_us: int
    host_ns: int

    def ns(self, t_us: int) -> int:
        return self.host_ns + (t_us - self.t_us) * 1000


class Plots:
    """Writes the messages of all fingers; a finger's topics appear with its first message."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._anchor: _Anchor | None = None
        self._channels: dict[tuple[str, int], int] = {}
        self._schemas: dict[str, int] = {}
        self._due_us: dict[tuple[str, int], int] = {}

    def add(self, batch: Batch, arrived_ns: int) -> bool:
        """Write what the next rows are good for; true if that was anything."""
        begin_us = batch.first_t_us()
        if self._anchor is None and begin_us is not None:
            self._anchor = _Anchor(begin_us, arrived_ns)
        if self._anchor is None:
            return False
        pac = {(int(row["finger"]), int(row["seq"])): row["pac"] for row in batch.pac[self._thinned("pac", batch.pac)]}
        messages: list[tuple[int, str, int, dict[str, Any]]] = []
        for k in self._thinned("results", batch.frames):
            messages.append(self._message("results", batch.frames[k], results(batch.wire[k])))
        for k in self._thinned("counts", batch.frames):
            row = batch.frames[k]
            block_of = pac.get((int(row["finger"]), int(row["seq"])))
            extra = {} if block_of is None else {"pac": block_of.tolist()}
            messages.append(self._message("counts", row, counts(row) | extra))
        for message in batch.messages:
            if isinstance(message, wire.Tare):
                messages.append(self._tare(message))
        for stamp_ns, topic, finger, body in sorted(messages, key=lambda m: m[0]):
            data = json.dumps(body, separators=(",", ":")).encode()
            self._writer.add_message(self._channel(topic, finger), stamp_ns, data, stamp_ns, body["seq"])
        return bool(messages)

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

    def _message(self, topic: str, row: Any, body: dict[str, Any]) -> tuple[int, str, int, dict[str, Any]]:
        return self._stamped(topic, int(row["finger"]), int(row["t_us"]), int(row["seq"]), body)

    def _tare(self, tare: wire.Tare) -> tuple[int, str, int, dict[str, Any]]:
        assert self._anchor is not None
        # Its 32-bit time, unwrapped to the half cycle around where the stream stands.
        elapsed_us = (tare.t_us - self._anchor.t_us) % 2**32
        unknown = 0xFFFFFFFF
        body = {
            "reason": _name(wire.TareReason, tare.reason),
            "state": _name(wire.TareState, tare.tare_state),
            "tare": [-1 if value == unknown else round(value / 65536, 4) for value in tare.tare_q16],
        }
        return self._stamped("tare", tare.finger, self._anchor.t_us + elapsed_us, tare.seq, body)

    def _stamped(
        self, topic: str, finger: int, t_us: int, seq: int, body: dict[str, Any]
    ) -> tuple[int, str, int, dict[str, Any]]:
        assert self._anchor is not None
        stamp_ns = max(0, self._anchor.ns(t_us))
        head = {
            "timestamp": {"sec": stamp_ns // 10**9, "nsec": stamp_ns % 10**9},
            "frame_id": layout.frame_id(finger),
            "seq": seq,
        }
        return stamp_ns, topic, finger, head | body

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
    """Raw counts of one frame, missing slow channels left out."""
    slow = {name: int(row[name]) for name in ("pdc", "tac", "tdc") if row[name] != wire.INVALID_COUNT}
    return {"electrodes": row["counts"].tolist()} | slow


def _name(kind: Any, value: int) -> str:
    return str(kind(value).name) if value in list(kind) else str(value)
