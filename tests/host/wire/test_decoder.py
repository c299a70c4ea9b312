"""Ownership of the compiled decoder's arguments and results; decoded bytes: test_intake, test_deframer_fuzz."""

import gc
import zlib
from dataclasses import asdict

import numpy as np
from deframer import encode

from biotac.wire import messages_gen as wire
from biotac.wire.decoder import STREAMED, Decoder
from biotac.wire.dtypes_gen import DTYPES
from biotac.wire.native import ffi, lib

Message = tuple[int, bytes]
UNKNOWN_ID = 0x7E


def messages(random: np.random.Generator, n: int) -> list[Message]:
    """``n`` random ones: mostly streams, a few of every kind and of an unknown one, with runs of zeros."""
    ids = np.where(random.random(n) < 0.8, random.choice(STREAMED, n), random.choice([*wire.MESSAGES, UNKNOWN_ID], n))
    out = []
    for message_id in ids.tolist():
        size = DTYPES[message_id].itemsize if message_id in DTYPES else int(random.integers(0, 250))
        payload = random.integers(0, 256, size, np.uint8)
        payload[random.random(size) < random.choice([0.0, 0.1, 0.9])] = 0
        out.append((message_id, payload.tobytes()[:249]))
    return out


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
        assert len(decoder.feed(b"\x55" * 10_000).packets) == 0
    ping = encode(wire.Ping.ID, b"\7")
    assert decoder.feed(b"\0" + ping).others == [(wire.Ping.ID, b"\7")]
    assert asdict(decoder.counts) == {"good": 1, "too_long": 1, "bad_cobs": 0, "bad_crc": 0, "bad_length": 0}


def test_the_fast_crc_is_zlibs_at_every_length() -> None:
    crc = ffi.new("bt_crc_fast *")
    lib.bt_crc_fast_set_up(crc)
    random = np.random.default_rng(11)
    for size in range(256):
        for data in (random.bytes(size), bytes(size), b"\xff" * size):
            assert lib.bt_crc_fast_compute(crc, data, size) == zlib.crc32(data), size
