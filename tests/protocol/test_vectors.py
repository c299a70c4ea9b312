"""protocol/vectors/ are complete, and the parts that only Python has agree; test_conformance.py asks for the rest."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from deframer import Deframer

from biotac.wire import messages_gen as wire
from biotac.wire.dtypes_gen import DTYPES

VECTORS = Path(__file__).resolve().parents[2] / "protocol" / "vectors"
REFUSALS = ("too_long", "bad_cobs", "bad_crc", "bad_length")


def lines(name: str) -> Iterator[list[str]]:
    for line in (VECTORS / name).read_text(encoding="ascii").splitlines():
        if line and not line.startswith("#"):
            yield line.split(" ")


def test_every_message_and_every_refusal_has_its_cases() -> None:
    assert {int(rest[1], 16) for word, *rest in lines("messages.txt") if word == "message"} == set(wire.MESSAGES)
    assert {int(rest[0], 16) for word, *rest in lines("framing.txt") if word == "frame"} >= set(wire.MESSAGES)
    counts = np.array([rest for word, *rest in lines("framing.txt") if word == "counts"], int)
    assert ((counts > 0).sum(axis=0) >= 2).all()


@pytest.mark.parametrize("size", [1, 7, 10_000])
def test_the_reference_that_others_are_judged_by_gives_each_case_its_frames_and_counts(size: int) -> None:
    deframer, data, frames = Deframer(), b"", []
    for word, *rest in lines("framing.txt"):
        if word == "case":
            deframer, data, frames = Deframer(), b"", []
        elif word == "wire":
            data += bytes.fromhex(rest[0].replace("-", ""))
        elif word == "frame":
            frames.append((int(rest[0], 16), bytes.fromhex(rest[1].replace("-", ""))))
        else:
            found = [frame for k in range(0, len(data), size) for frame in deframer.feed(data[k : k + size])]
            assert found == frames
            assert [getattr(deframer.counts, name) for name in REFUSALS] == list(map(int, rest))


def test_the_array_types_read_the_same_fields() -> None:
    message_id, fields = 0, {}
    for word, *rest in lines("messages.txt"):
        if word == "message":
            message_id, fields = int(rest[1], 16), {}
        elif word == "payload":
            payload = bytes.fromhex(rest[0])
            rows = np.frombuffer(payload * 2, dtype=DTYPES[message_id])
            assert len(rows) == 2 and rows.dtype.names == tuple(fields)
            for name, values in fields.items():
                for row in rows:
                    assert np.atleast_1d(row[name]).tolist() == values, name
        else:
            fields[word] = list(map(int, rest))
