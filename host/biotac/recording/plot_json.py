"""JSON messages of a recording and their schemas.

An invalid value is left out, or null in a list: JSON has no NaN. The schemas do not declare that a list can hold null,
because the programs that read them do not support union types.
"""

from __future__ import annotations

import json
from typing import Any

from ..wire import messages_gen as wire
from ..wire.events import event_age_s, kind_name
from ..wire.fields import INVALID_U32
from . import layout


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
        "pressure_force_n": _number("magnitude of the force from static pressure, N; absent unless calibrated"),
        "torsion_nm": _number(
            "torque about the outward normal at the contact, N*m; absent unless a wrench map gives it"
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
EVENT_SCHEMA = {
    "title": "biotac.Event",
    "type": "object",
    "properties": _HEAD
    | {
        "kind": {"type": "string", "description": "enum event_kind in MESSAGES.md"},
        "age_s": _number("how long ago it began, s"),
        "energy": _number("of a touch or lift: sum of squares of the signals, count^2"),
        "peak": _number("of a jolt or slip: largest change of dynamic pressure within 3.6 ms, count"),
    },
}
SCHEMAS = {"results": RESULTS_SCHEMA, "counts": COUNTS_SCHEMA, "tare": TARE_SCHEMA, "events": EVENT_SCHEMA}


def encoded(body: dict[str, Any], finger: int, seq: int, stamp_ns: int) -> bytes:
    """A message: the head, then ``body``."""
    head = {
        "timestamp": {"sec": stamp_ns // 10**9, "nsec": stamp_ns % 10**9},
        "frame_id": layout.frame_id(finger),
        "seq": seq,
    }
    return json.dumps(head | body, separators=(",", ":")).encode()


def results(row: Any) -> dict[str, Any]:
    """A FRAME message's results in SI units, invalid values left out."""
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


def counts(row: Any, pac: Any = None) -> dict[str, Any]:
    """Raw counts of one frame and its PAC samples; missing values in lists are null, missing slow channels left out."""
    slow = {name: int(row[name]) for name in ("pdc", "tac", "tdc") if row[name] != wire.INVALID_COUNT}
    block = {} if pac is None else {"pac": _count_list(pac)}
    return {"electrodes": _count_list(row["counts"])} | slow | block


def tare_change(tare: wire.Tare) -> dict[str, Any]:
    """A TARE message's contents, null for electrodes without a tare."""
    return {
        "reason": _name(wire.TareReason, tare.reason),
        "state": _name(wire.TareState, tare.tare_state),
        "tare": [None if value == INVALID_U32 else round(value / 65536, 4) for value in tare.tare_q16],
    }


def event(told: wire.Event) -> dict[str, Any]:
    """An EVENT message's contents, invalid values left out."""
    body: dict[str, Any] = {"kind": kind_name(told), "age_s": event_age_s(told)}
    if told.energy_count2 != INVALID_U32:
        body["energy"] = told.energy_count2
    if told.peak_count != wire.INVALID_COUNT:
        body["peak"] = told.peak_count
    return body


def _count_list(values: Any) -> list[int | None]:
    return [None if value == wire.INVALID_COUNT else value for value in values.tolist()]


def _name(kind: Any, value: int) -> str:
    return str(kind(value).name) if value in list(kind) else str(value)
