"""Packets of a board with another wire schema, as this version's: a recording carries the schema of its packets.

Messages, fields, enum values and flags are found by name. A field that the recording lacks is at its invalid mark, a
value without a name here has no meaning here, and a message that is gone is omitted.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

from ..errors import RecordingError
from ..wire.decoder import packed, pairs
from ..wire.fields import WIRE_INVALID
from ..wire.native import BUILT

_CHAR = {"u8": "B", "u16": "H", "u32": "I", "i8": "b", "i16": "h", "i32": "i"}
_INVALID = {"u8": "u1", "u16": "u2", "u32": "u4", "i16": "i2", "i32": "i4"}

Link = Mapping[str, Any]
Convert = Callable[[bytes], bytes]


@cache
def own_schema() -> bytes:
    """protocol/schema.json of this version without texts, as a recording carries it."""
    return json.dumps(_without_texts(json.loads((BUILT / "schema.json").read_bytes())), separators=(",", ":")).encode()


def _without_texts(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_texts(own) for key, own in value.items() if key != "doc"}
    return [_without_texts(own) for own in value] if isinstance(value, list) else value


def translation_of(stored: bytes) -> Translation | None:
    """The translation from the schema ``stored`` to this version's packets; None where they are the same.

    Raises RecordingError for one that cannot be read.
    """
    own = own_schema()
    if stored in (b"", own):
        return None
    try:
        made = Translation(json.loads(stored)["link"], json.loads(own)["link"])
    except (KeyError, TypeError, ValueError, AttributeError, struct.error) as error:
        raise RecordingError(f"the recording's wire schema cannot be read ({error!r}); try another copy") from error
    return made if made.changes else None


class Translation:
    """``changes``: whether there is anything to translate."""

    def __init__(self, stored: Link, own: Link) -> None:
        self._values = _values(stored, own)
        self._of: dict[int, tuple[int, Convert | None]] = {}
        for name, message in stored["message"].items():
            target = own["message"].get(name)
            if target is not None:
                same = self._is_same(message, target)
                convert = None if same else self._converter(message["fields"], target["fields"])
                self._of[int(message["id"])] = int(target["id"]), convert
        reused = {int(message["id"]) for message in own["message"].values()}
        gone = {int(message["id"]) for message in stored["message"].values()} - self._of.keys()
        self._gone = gone | (reused - self._of.keys())
        self.changes = bool(gone) or any(at != to or convert for at, (to, convert) in self._of.items())

    def of(self, packets: bytes) -> bytes:
        """``packets`` as this version's board would have sent them. Raises struct.error for one that is too short."""
        out = []
        for message_id, payload in pairs(packets):
            if message_id in self._gone:
                continue
            to, convert = self._of.get(message_id, (message_id, None))
            out.append((to, payload if convert is None else convert(payload)))
        return packed(out)

    def _is_same(self, stored: Link, own: Link) -> bool:
        fields = zip(stored["fields"], own["fields"], strict=False)
        same = all(all(a.get(k) == b.get(k) for k in ("name", "type", "count", "unit")) for a, b in fields)
        known = all(self._values.get(field["unit"]) is None for field in own["fields"])
        return same and known and len(stored["fields"]) >= len(own["fields"])

    def _converter(self, stored: list[Link], own: list[Link]) -> Convert:
        read, write = (struct.Struct("<" + "".join(map(_format, fields))) for fields in (stored, own))
        at, n = {}, 0
        for field in stored:
            at[field["name"]] = n, field
            n += int(field.get("count", 1))
        steps = [(field, *at.get(field["name"], (None, field))) for field in own]

        def convert(payload: bytes) -> bytes:
            values = read.unpack_from(payload)
            out: list[int] = []
            for field, begin, source in steps:
                count = int(field.get("count", 1))
                given = () if begin is None else values[begin : begin + min(count, int(source.get("count", 1)))]
                value_of = self._values.get(field["unit"]) or (lambda value: value)
                out += [_within(field["type"], value_of(value)) for value in given]
                out += [WIRE_INVALID.get(_INVALID.get(field["type"], ""), 0)] * (count - len(given))
            return write.pack(*out)

        return convert


def _format(field: Link) -> str:
    return f"{int(field.get('count', 1))}{_CHAR[field['type']]}"


def _within(kind: str, value: int) -> int:
    bits = int(kind[1:])
    low, high = (0, 1 << bits) if kind[0] == "u" else (-(1 << bits - 1), 1 << bits - 1)
    return max(low, min(value, high - 1))


def _values(stored: Link, own: Link) -> dict[str, Callable[[int], int] | None]:
    """By unit: the function from a stored value to this version's; None where they are the same."""
    made: dict[str, Callable[[int], int] | None] = {}
    for name, values in own["enum"].items():
        made[f"enum {name}"] = _renumbered(_numbers(stored["enum"].get(name, {}), "value"), _numbers(values, "value"))
    for name, bits in own["flags"].items():
        made[f"flags {name}"] = _moved(_numbers(stored["flags"].get(name, {}), "bit"), _numbers(bits, "bit"))
    for unit, kind in (("message id", "message"), ("setting id", "setting")):
        made[unit] = _renumbered(_numbers(stored[kind], "id"), _numbers(own[kind], "id"))
    return made


def _numbers(named: Mapping[str, Any], key: str) -> dict[str, int]:
    return {name: int(about[key]) for name, about in named.items()}


def _renumbered(stored: Mapping[str, int], own: Mapping[str, int]) -> Callable[[int], int] | None:
    """A value of a name that is gone is one that nothing here uses."""
    if all(own.get(name) == value for name, value in stored.items()):
        return None
    unused = next(value for value in range(254, -1, -1) if value not in own.values())
    to = {value: own.get(name, unused) for name, value in stored.items()}
    taken = {*own.values()} - {*stored.values()}
    return lambda value: to.get(value, unused if value in taken else value)


def _moved(stored: Mapping[str, int], own: Mapping[str, int]) -> Callable[[int], int] | None:
    if all(own.get(name) == bit for name, bit in stored.items()):
        return None
    pairs_of = [(bit, own[name]) for name, bit in stored.items() if name in own]

    @cache
    def moved(value: int) -> int:
        return sum(1 << to for bit, to in pairs_of if value >> bit & 1)

    return moved
