"""The compiled decoder against the reference deframer: damage, chunking, lengths, and who owns what it returns."""

from __future__ import annotations

import gc
import zlib
from collections.abc import Iterator
from dataclasses import asdict

import numpy as np
import pytest
from deframer import Deframer, encode

from biotac.wire import messages_gen as wire
from biotac.wire.decoder import STREAMED, Decoded, Decoder
from biotac.wire.dtypes_gen import DTYPES
from biotac.wire.native import ffi, lib

Message = tuple[int, bytes]
UNKNOWN_ID = 0x7E
STEP_BYTES = lib.BT_DECODE_BYTES  # where the decoder itself cuts


def messages(random: np.random.Generator, n: int, longer_by: int = 0) -> list[Message]:
    """``n`` random ones: mostly streams, a few of every kind and of an unknown one, with runs of zeros."""
    ids = np.where(random.random(n) < 0.8, random.choice(STREAMED, n), random.choice([*wire.MESSAGES, UNKNOWN_ID], n))
    out = []
    for message_id in ids.tolist():
        size = DTYPES[message_id].itemsize if message_id in DTYPES else int(random.integers(0, 250))
        size += longer_by if random.random() < 0.1 else 0
        payload = random.integers(0, 256, size, np.uint8)
        payload[random.random(size) < random.choice([0.0, 0.1, 0.9])] = 0
        out.append((message_id, payload.tobytes()[:249]))
    return out


def damaged(random: np.random.Generator, data: bytes, rate: float) -> bytes:
    """Bytes flipped, dropped and repeated, and a delimiter here and there."""
    raw = np.frombuffer(data, np.uint8).copy()
    hit = random.random(len(raw)) < rate
    raw[hit] ^= (1 << random.integers(0, 8, hit.sum())).astype(np.uint8)
    raw[random.random(len(raw)) < rate / 4] = 0
    copies = np.ones(len(raw), int)
    copies[random.random(len(raw)) < rate] = 0
    copies[random.random(len(raw)) < rate / 4] = 300  # more than any frame has
    return np.repeat(raw, copies).tobytes()


def cut(random: np.random.Generator, data: bytes, longest: int) -> Iterator[bytes]:
    at = 0
    while at < len(data):
        size = int(random.integers(0, longest + 1))
        yield data[at : at + size]
        at += size


def assert_rows_are_those_of(decoded: Decoded, got: list[Message]) -> None:
    for message_id, rows in zip(STREAMED, (decoded.frames, decoded.pacs, decoded.idles), strict=True):
        assert rows.dtype == DTYPES[message_id]
        assert rows.tobytes() == b"".join(payload for i, payload in got if i == message_id)
    assert decoded.others == [(i, payload) for i, payload in got if i not in STREAMED]
    assert list(decoded.ids) == [i for i, _ in got]


@pytest.mark.parametrize(
    ("rate", "longest", "allow_longer"),
    [(0.0, 64, False), (0.0, 4096, True), (1e-3, 3, True), (1e-2, 4096, False), (1e-2, 100_000, True)],
)
def test_the_reference_finds_the_same_messages_and_damage(rate: float, longest: int, allow_longer: bool) -> None:
    random = np.random.default_rng([int(rate * 1e4), longest, allow_longer])
    data = b"".join(encode(*m) for m in messages(random, 600, longer_by=3))
    data = damaged(random, data, rate) if rate else data
    decoder, reference = Decoder(), Deframer()
    reference.allow_longer = allow_longer
    if allow_longer:
        decoder.accept_newer_minor()
    for chunk in cut(random, data, longest):
        decoded, want = decoder.feed(chunk), reference.feed(chunk)
        assert decoded.messages() == want
        assert_rows_are_those_of(decoded, want)
    assert decoder.counts == reference.counts
    seen = asdict(reference.counts)
    assert seen["good"] > 100
    assert (seen["bad_length"] > 0) == (not allow_longer)
    if rate:
        assert min(seen["too_long"], seen["bad_cobs"], seen["bad_crc"]) > 0


@pytest.mark.parametrize("offset", [-1, 0, 1])
def test_a_chunk_longer_than_the_decoders_own_step_is_one_chunk(offset: int) -> None:
    random = np.random.default_rng(5)
    data = b"".join(encode(*m) for m in messages(random, 5000))
    data = data[: 2 * STEP_BYTES + offset]
    reference = Deframer()
    want = reference.feed(data)
    decoded = Decoder().feed(data)
    assert decoded.messages() == want
    assert_rows_are_those_of(decoded, want)


def test_noise_is_no_message() -> None:
    random = np.random.default_rng(6)
    noise = random.integers(0, 256, 1_000_000, np.uint8).tobytes()
    decoder, reference = Decoder(), Deframer()
    assert decoder.feed(noise).messages() == reference.feed(noise) == []
    assert decoder.counts == reference.counts
    assert decoder.counts.bad > 3_000


@pytest.mark.parametrize("fill", [b"\0", b"\1", b"\xff", b"\0\1", b"\1\1\1\1\1\1\1\0"])
def test_every_length_of_payload_arrives(fill: bytes) -> None:
    payloads = [(fill * size)[:size] for size in range(250)]
    decoded = Decoder().feed(b"".join(encode(UNKNOWN_ID, payload) for payload in payloads))
    assert decoded.others == [(UNKNOWN_ID, payload) for payload in payloads]


@pytest.mark.parametrize("bit", range(8))
def test_no_flipped_bit_is_accepted_wherever_it_is(bit: int) -> None:
    sent = messages(np.random.default_rng(7), 200)
    message = next((i, p) for i, p in sent if i == wire.Frame.ID and p.count(0) == 0)
    good = encode(*message)
    for at in range(len(good)):
        flipped = good[:at] + bytes([good[at] ^ 1 << bit]) + good[at + 1 :]
        decoder = Decoder()
        assert len(decoder.feed(flipped + b"\0").ids) == 0, at
        assert decoder.counts.bad > 0


def test_what_was_returned_outlives_the_decoder_and_its_next_chunks() -> None:
    random = np.random.default_rng(8)
    sent = messages(random, 500)
    data = b"".join(encode(*m) for m in sent)
    decoder = Decoder()
    first = decoder.feed(data)
    before = first.messages()
    for _ in range(20):
        decoder.feed(data[::-1])
    del decoder
    gc.collect()
    Decoder().feed(data[::-1])
    assert first.messages() == before == sent
    assert not first.frames.flags.writeable


def test_a_reused_read_buffer_is_taken_and_let_go() -> None:
    sent = messages(np.random.default_rng(9), 40)
    data = b"".join(encode(*m) for m in sent)
    buffer = bytearray(data)
    decoder = Decoder()
    got = [decoder.feed(memoryview(buffer)[:1001]), decoder.feed(memoryview(buffer)[1001:])]
    buffer[:] = bytes(len(buffer))
    buffer.clear()  # BufferError if anyone still held it
    assert [m for decoded in got for m in decoded.messages()] == sent


def test_a_delimiter_that_never_comes_fills_no_memory_and_costs_one_frame() -> None:
    decoder = Decoder()
    for _ in range(100):
        assert len(decoder.feed(b"\x55" * 10_000).ids) == 0
    ping = encode(wire.Ping.ID, b"\7")
    assert decoder.feed(b"\0" + ping).others == [(wire.Ping.ID, b"\7")]
    assert asdict(decoder.counts) == {"good": 1, "too_long": 1, "bad_cobs": 0, "bad_crc": 0, "bad_length": 0}


def test_the_fast_crc_is_zlibs_at_every_length() -> None:
    crc = ffi.new("bt_crc_fast *")
    lib.bt_crc_fast_set_up(crc)
    random = np.random.default_rng(11)
    for size in range(256):
        for data in (random.bytes(size), bytes(size), b"\xff" * size):
            assert lib.bt_crc_fast_of(crc, data, size) == zlib.crc32(data), size
