"""protocol/vectors/ against the Python side; the C tests read the same files (tests/core)."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from pathlib import Path

import numpy as np
import pytest
from cobs import cobs
from deframer import Deframer

from biotac.wire import messages_gen as wire
from biotac.wire.decoder import Decoder
from biotac.wire.dtypes_gen import DTYPES
from biotac.wire.framing import FramingCounts, encode

VECTORS = Path(__file__).resolve().parents[2] / "protocol" / "vectors"
CHUNK_BYTES = (1, 2, 3, 5, 7, 13, 63, 64, 65, 255, 10_000)


@dataclass
class FramingCase:
    name: str
    wire: bytes = b""
    frames: list[tuple[int, bytes]] = field(default_factory=list)
    counts: dict[str, int] = field(default_factory=dict)


@dataclass
class MessageVector:
    message_id: int
    name: str
    case: str
    fields: dict[str, list[int]] = field(default_factory=dict)
    payload: bytes = b""


def lines(name: str) -> Iterator[list[str]]:
    for line in (VECTORS / name).read_text(encoding="ascii").splitlines():
        if line and not line.startswith("#"):
            yield line.split(" ")


def unhex(text: str) -> bytes:
    return b"" if text == "-" else bytes.fromhex(text)


def framing_cases() -> list[FramingCase]:
    cases: list[FramingCase] = []
    for word, *rest in lines("framing.txt"):
        if word == "case":
            cases.append(FramingCase(rest[0]))
        elif word == "wire":
            cases[-1].wire += unhex(rest[0])
        elif word == "frame":
            cases[-1].frames.append((int(rest[0], 16), unhex(rest[1])))
        else:
            assert word == "counts"
            cases[-1].counts = dict(zip(("too_long", "bad_cobs", "bad_crc", "bad_length"), map(int, rest), strict=True))
    return cases


def message_vectors() -> list[MessageVector]:
    vectors: list[MessageVector] = []
    for word, *rest in lines("messages.txt"):
        if word == "message":
            vectors.append(MessageVector(int(rest[1], 16), rest[0], rest[2]))
        elif word == "payload":
            vectors[-1].payload = unhex(rest[0])
        else:
            vectors[-1].fields[word] = [int(v) for v in rest]
    return vectors


FRAMING = framing_cases()
MESSAGES = message_vectors()
each_case = pytest.mark.parametrize("case", FRAMING, ids=lambda c: c.name)
each_message = pytest.mark.parametrize("vector", MESSAGES, ids=lambda v: f"{v.name}-{v.case}")


def chunks(data: bytes, size: int) -> list[bytes]:
    return [data[k : k + size] for k in range(0, len(data), size)]


class Compiled:
    """The library's decoder, with the messages as the reference gives them."""

    def __init__(self) -> None:
        self._decoder = Decoder()

    @property
    def counts(self) -> FramingCounts:
        return self._decoder.counts

    def feed(self, chunk: bytes) -> list[tuple[int, bytes]]:
        return self._decoder.feed(chunk).messages()


both = pytest.mark.parametrize("kind", [Compiled, Deframer], ids=["library", "reference"])


@both
@each_case
@pytest.mark.parametrize("size", CHUNK_BYTES)
def test_every_case_gives_its_frames_and_counts_in_chunks_of_any_size(
    case: FramingCase, size: int, kind: type[Compiled | Deframer]
) -> None:
    deframer = kind()
    frames = [frame for chunk in chunks(case.wire, size) for frame in deframer.feed(chunk)]
    assert frames == case.frames
    assert {name: getattr(deframer.counts, name) for name in case.counts} == case.counts
    assert deframer.counts.good == len(case.frames)


@both
def test_one_deframer_takes_all_cases_in_a_row(kind: type[Compiled | Deframer]) -> None:
    deframer = kind()
    frames = []
    for case in FRAMING:
        frames += deframer.feed(case.wire + b"\0")
    assert frames[: len(FRAMING[0].frames)] == FRAMING[0].frames
    # Every case's own frames, none lost to the case before.
    assert frames == [frame for case in FRAMING for frame in case.frames + finished_by_delimiter(case)]


def finished_by_delimiter(case: FramingCase) -> list[tuple[int, bytes]]:
    """What one more 0x00 makes of a case that ends within a frame."""
    return Deframer().feed(case.wire + b"\0")[len(case.frames) :]


@each_case
def test_every_accepted_frame_is_encoded_to_the_bytes_it_came_in(case: FramingCase) -> None:
    rest = case.wire
    for message_id, payload in case.frames:
        before, found, rest = rest.partition(encode(message_id, payload))
        assert found, before


def test_there_is_a_case_for_every_message_and_every_kind_of_refusal() -> None:
    assert {i for i, _ in FRAMING[0].frames} == set(wire.MESSAGES)
    for kind in ("too_long", "bad_cobs", "bad_crc", "bad_length"):
        assert sum(case.counts[kind] > 0 for case in FRAMING) >= 2, kind


@each_message
def test_unpack_gives_the_fields_and_pack_the_payload(vector: MessageVector) -> None:
    message_type = wire.MESSAGES[vector.message_id]
    message = message_type.unpack(vector.payload)
    assert [f.name for f in fields(message_type)] == list(vector.fields)
    for name, want in vector.fields.items():
        value = getattr(message, name)
        assert (list(value) if isinstance(value, tuple) else [value]) == want, name
    assert message.pack() == vector.payload


@each_message
def test_the_array_type_reads_the_same_fields(vector: MessageVector) -> None:
    dtype = DTYPES[vector.message_id]
    assert dtype.itemsize == len(vector.payload)
    rows = np.frombuffer(vector.payload * 2, dtype=dtype)
    assert rows.dtype.names == tuple(vector.fields)
    for name, want in vector.fields.items():
        for row in rows:
            assert np.atleast_1d(row[name]).tolist() == want, name


def test_every_message_has_vectors() -> None:
    assert {v.message_id for v in MESSAGES} == set(wire.MESSAGES)


def test_crc32_known_answers_hold() -> None:
    answers = {unhex(data): int(crc, 16) for crc, data in lines("crc32.txt")}
    assert answers[b"123456789"] == 0xCBF43926
    assert all(zlib.crc32(data) == crc for data, crc in answers.items())


def test_cobs_known_answers_hold() -> None:
    for word, *rest in lines("cobs.txt"):
        if word == "good":
            plain, encoded = map(unhex, rest)
            assert (cobs.encode(plain), cobs.decode(encoded)) == (encoded, plain)
        else:
            with pytest.raises(cobs.DecodeError):
                cobs.decode(unhex(rest[0]))
