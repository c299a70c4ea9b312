"""The firmware's byte-wise deframer and the host's compiled one against the reference: same bytes, same outcome."""

import zlib

import pytest
from biotac._core import ffi, lib
from cobs import cobs
from deframer import Deframer
from deframer import encode as reference_encode
from hypothesis import given, settings
from hypothesis import strategies as st

from biotac.wire import messages_gen as wire
from biotac.wire.decoder import Decoder
from biotac.wire.framing import FramingCounts, encode

OUTCOMES = {2: "too_long", 3: "bad_cobs", 4: "bad_crc", 5: "bad_length"}


def deframe_in_c(stream: bytes) -> tuple[list[tuple[int, bytes]], dict[str, int]]:
    deframer = ffi.new("bt_deframer *")
    lib.bt_deframer_reset(deframer)
    frames = []
    counts = dict.fromkeys(OUTCOMES.values(), 0)
    for byte in stream:
        outcome = lib.bt_deframer_push(deframer, byte)
        if outcome == 1:
            payload = bytes(ffi.buffer(deframer.buffer))[1 : 1 + deframer.payload_bytes]
            frames.append((deframer.id, payload))
        elif outcome:
            counts[OUTCOMES[outcome]] += 1
    return frames, counts


def refusals(counts: FramingCounts) -> dict[str, int]:
    return {name: getattr(counts, name) for name in OUTCOMES.values()}


def deframe_in_python(chunks: list[bytes]) -> tuple[list[tuple[int, bytes]], dict[str, int]]:
    deframer = Deframer()
    frames = [frame for chunk in chunks for frame in deframer.feed(chunk)]
    return frames, refusals(deframer.counts)


def decode_in_c(chunks: list[bytes]) -> tuple[list[tuple[int, bytes]], dict[str, int]]:
    decoder = Decoder()
    frames = [frame for chunk in chunks for frame in decoder.feed(chunk).messages()]
    return frames, refusals(decoder.counts)


known_payload = st.sampled_from(sorted(wire.MESSAGES)).flatmap(
    lambda i: st.tuples(
        st.just(i), st.binary(min_size=wire.MESSAGES[i].STRUCT.size, max_size=wire.MESSAGES[i].STRUCT.size)
    )
)
any_payload = st.tuples(st.integers(0, 255), st.binary(max_size=249))
good_frame = st.one_of(known_payload, any_payload).map(lambda m: encode(*m))
damaged_frame = st.tuples(good_frame, st.integers(0, 10_000), st.integers(0, 255)).map(
    lambda t: t[0][: t[1] % len(t[0])] + bytes([t[2]]) + t[0][t[1] % len(t[0]) + 1 :]
)
cut_frame = st.tuples(good_frame, st.integers(0, 10_000)).map(lambda t: t[0][: t[1] % len(t[0])])
junk = st.one_of(
    st.binary(max_size=40),
    st.sampled_from([b"AT+CGMI\r\n", b"\0\0\0", b"\xff" * 300, b"\x01" * 255 + b"\0", b"\x01" * 256 + b"\0"]),
)
streams = st.lists(st.one_of(good_frame, damaged_frame, cut_frame, junk), max_size=8).map(b"".join)


@settings(max_examples=400, deadline=None)
@given(streams, st.lists(st.integers(1, 300), min_size=1, max_size=20))
def test_all_deframers_accept_the_same_frames_for_the_same_reasons(stream: bytes, cuts: list[int]) -> None:
    chunks = []
    at = 0
    while at < len(stream):
        step = cuts[len(chunks) % len(cuts)]
        chunks.append(stream[at : at + step])
        at += step
    assert decode_in_c(chunks) == deframe_in_python(chunks) == deframe_in_c(stream)


@settings(max_examples=200, deadline=None)
@given(any_payload)
def test_the_encoder_writes_what_the_libraries_would(message: tuple[int, bytes]) -> None:
    assert encode(*message) == reference_encode(*message)


def test_a_payload_that_fits_no_frame_is_refused() -> None:
    with pytest.raises(ValueError, match="250 bytes, expected at most 249"):
        encode(0x55, bytes(250))


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=300), st.binary(max_size=300))
def test_cobs_and_crc_agree_with_the_libraries(data: bytes, noise: bytes) -> None:
    out = ffi.new("uint8_t[]", 700)
    assert lib.bt_crc32(data, len(data)) == zlib.crc32(data)
    for stuffed in (cobs.encode(data), noise.replace(b"\0", b"\1")):
        n = lib.bt_cobs_decode(stuffed, len(stuffed), out)
        try:
            want = cobs.decode(stuffed)
        except cobs.DecodeError:
            assert n == -1
        else:
            assert bytes(ffi.buffer(out, n)) == want
