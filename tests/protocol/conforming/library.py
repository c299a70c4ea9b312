"""The library's wire for protocol/conformance: a request a line in, an answer a line out."""

import dataclasses
import sys
import zlib
from collections.abc import Iterator
from typing import Any

from biotac.wire import messages_gen as wire
from biotac.wire.decoder import Decoder
from biotac.wire.framing import encode


def unhex(text: str) -> bytes:
    return b"" if text == "-" else bytes.fromhex(text)


def unframed(size: int, data: bytes) -> Iterator[str]:
    decoder = Decoder()
    for at in range(0, len(data), size):
        for message_id, payload in decoder.feed(data[at : at + size]).messages():
            yield f"frame {message_id:02x} {payload.hex() or '-'}"
    counts = decoder.counts
    yield f"counts {counts.too_long} {counts.bad_cobs} {counts.bad_crc} {counts.bad_length}"


def unpacked(kind: Any, payload: bytes) -> Iterator[str]:
    for field, value in dataclasses.asdict(kind.unpack(payload)).items():
        yield " ".join([field, *map(str, value if isinstance(value, tuple) else [value])])


def packed(kind: Any, fields: str) -> bytes:
    blank = dataclasses.asdict(kind.unpack(bytes(kind.STRUCT.size)))
    values: dict[str, Any] = {}
    for field, *numbers in (text.split(" ") for text in fields.split("; ")):
        values[field] = tuple(map(int, numbers)) if isinstance(blank[field], tuple) else int(numbers[0])
    return kind(**values).pack()


def answer(word: str, rest: str) -> str:
    first, _, more = rest.partition(" ")
    if word == "crc":
        return f"{zlib.crc32(unhex(rest)):08x}"
    if word == "frame":
        return encode(int(first, 16), unhex(more)).hex()
    if word == "unframe":
        return "; ".join(unframed(int(first), unhex(more)))
    if word == "unpack":
        return "; ".join(unpacked(wire.MESSAGES[int(first, 16)], unhex(more)))
    if word == "pack":
        return packed(wire.MESSAGES[int(first, 16)], more).hex()
    return "no"


for line in sys.stdin:
    word, _, rest = line.rstrip("\n").partition(" ")
    print(answer(word, rest))
