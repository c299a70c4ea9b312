"""Sequence numbers, device time and losses across wraps, gaps and fingers."""

import threading

import live_board
import numpy as np
import pytest

from biotac.wire import messages_gen as wire
from biotac.wire.batches import StreamDecoder
from biotac.wire.decoder import STEP_BYTES, STREAMED
from biotac.wire.dtypes_gen import DTYPES
from biotac.wire.framing import encode
from biotac.wire.native import ffi, lib


def frame(finger: int, seq: int, t_us: int, **fields: object) -> bytes:
    return live_board.frame(seq, finger, t_us=t_us, **fields)


def status(uptime_s: int) -> bytes:
    values = [uptime_s * 10**6 % 2**32, 0, uptime_s, *[0] * 14]
    return encode(wire.Status.ID, wire.Status(0, *values, finger_faults=(0,) * 5).pack())


def idle(finger: int, seq: int, t_us: int, frames: int) -> bytes:
    message = wire.Idle(seq % 2**16, t_us % 2**32, finger, 1, 0, frames, 17, 2400, 1000, 3)
    return encode(wire.Idle.ID, message.pack())


def test_integers_become_mm_n_and_nmm() -> None:
    sent = frame(
        0,
        0,
        0,
        poc_um=(1000, -2000, -5080),
        force_100un=(10000, -20000, 50000),
        torque_mnmm=(1000, 2000, -3000),
        pdc_filtered_q4=2412 * 16 + 8,
        pressure_force_100un=-1250,
        torsion_mnmm=-4750,
    )
    row = StreamDecoder().feed(sent).frames[0]
    assert row["poc_mm"].tolist() == [1.0, -2.0, -5.08]
    assert row["force_n"].tolist() == [1.0, -2.0, 5.0]
    assert row["torque_nmm"].tolist() == [1.0, 2.0, -3.0]
    assert (row["pdc_filtered"], row["pressure_force_n"]) == (2412.5, -0.125)
    assert row["torsion_nmm"] == -4.75


def test_an_invalid_result_is_nan_and_never_zero() -> None:
    row = (
        StreamDecoder()
        .feed(
            frame(
                0,
                0,
                0,
                poc_um=(wire.INVALID_I16,) * 3,
                torque_mnmm=(wire.INVALID_I32, 0, 5),
                pdc_filtered_q4=wire.INVALID_COUNT,
                pressure_force_100un=wire.INVALID_I32,
                torsion_mnmm=wire.INVALID_I32,
                normal_mn=2050,
                normal_half_mn=wire.INVALID_COUNT,
            )
        )
        .frames[0]
    )
    assert np.isnan(row["poc_mm"]).all()
    assert np.isnan(row["torque_nmm"][0])
    assert row["torque_nmm"][1:].tolist() == [0.0, 0.005]
    assert not np.isnan(row["force_n"]).any()
    assert np.isnan(row["pdc_filtered"]) and np.isnan(row["pressure_force_n"]) and np.isnan(row["torsion_nmm"])
    assert row["normal_n"] == 2.05 and np.isnan(row["normal_half_n"]) and row["shear_n"] == 0.0


@pytest.mark.parametrize("together", [True, False])
def test_heartbeats_account_for_the_rounds_without_a_frame(together: bool) -> None:
    sent = [
        frame(0, 65530, 0),
        idle(0, 65540, 100_000, 10),  # 65531..65540, across the wrap
        idle(0, 65545, 150_000, 5),
        frame(0, 65546, 160_000),
        frame(0, 65547, 170_000),
    ]
    decoder = StreamDecoder()
    batches = [decoder.feed(b"".join(sent))] if together else [decoder.feed(s) for s in sent]
    assert (decoder.lost, decoder.disordered) == (0, 0)
    heartbeats = np.concatenate([b.idle for b in batches])
    assert heartbeats["seq"].tolist() == [65540, 65545]
    assert heartbeats["t_us"].tolist() == [100_000, 150_000]
    assert heartbeats["frames"].tolist() == [10, 5]
    assert heartbeats["energy_count2"].tolist() == [17, 17]
    assert batches[-1].last_t_us() == 170_000
    assert (batches[0].first_t_us(), decoder.feed(b"").first_t_us()) == (0, None)
    assert together or batches[1].first_t_us() == 100_000
    assert np.isnan(batches[0].taken_s)  # without a time: these bytes came from no board


def test_the_parts_of_a_long_read_keep_their_fingers() -> None:
    sent = b"".join(frame(finger, seq, 10_000 * seq) for seq in range(STEP_BYTES // 150) for finger in (0, 3))
    assert len(sent) > STEP_BYTES and StreamDecoder().feed(sent).fingers == 0b1001


def test_a_newer_minor_may_append_fields_and_messages() -> None:
    """SPEC.md, Versions; the field and the message are made up."""
    payload = wire.Reply(7, 0x81, 0).pack()
    longer, shorter = encode(wire.Reply.ID, payload + b"new"), encode(wire.Reply.ID, payload[:-1])
    strict, lenient = StreamDecoder(), StreamDecoder()
    assert 0x7E not in wire.MESSAGES
    assert lenient.feed(encode(0x7E, b"a new message")).messages == []
    assert lenient.counts.bad == 0
    lenient.accept_newer_minor()
    assert strict.feed(longer).messages == []
    assert lenient.feed(longer).messages == [wire.Reply(7, 0x81, 0)]
    assert lenient.feed(shorter).messages == []
    assert (strict.counts.bad_length, lenient.counts.bad_length) == (1, 1)


def test_losses_longer_than_the_numbers_are_counted_by_device_time() -> None:
    rounds = np.array([0, 1, 34_418, 34_419, 234_419, 234_420])  # 344 s and 2000 s away
    t_us = rounds * 10_000 + 2**32 - 10**8
    sent = b"".join(
        encode(wire.Pac.ID, wire.Pac(int(seq) % 65536, int(t) % 2**32, 0, (2000,) * 22).pack())
        for seq, t in zip(rounds, t_us, strict=True)
    )
    decoder = StreamDecoder()
    batch = decoder.feed(sent)
    assert (np.diff(batch.pac["seq"]) == np.diff(rounds)).all()
    assert (np.diff(batch.pac["t_us"]) == np.diff(t_us)).all()
    assert decoder.lost_pac == rounds[-1] + 1 - len(rounds)


def test_numbers_that_follow_directly_do_so_after_any_silence() -> None:
    t_us = [10_000, 20_000, 1_000_020_000, 1_000_040_000]
    rows = [wire.Pac(seq, t, 0, (2000,) * 22).pack() for seq, t in zip((65_535, 0, 1, 3), t_us, strict=True)]
    decoder = StreamDecoder()
    batch = decoder.feed(b"".join(encode(wire.Pac.ID, row) for row in rows))
    assert np.diff(batch.pac["seq"]).tolist() == [1, 1, 2] and decoder.lost_pac == 1


def test_device_time_goes_on_over_its_wraps() -> None:
    truth = 2**32 - 10**6 + np.cumsum(np.random.default_rng(2).integers(-(10**6), 2**32 - 10**8, 1000))
    clock = ffi.new("bt_unwrapper *")
    got = []
    for raw in (truth % 2**32).tolist():
        peeked = lib.bt_unwrapped(clock, raw)
        got.append(lib.bt_unwrap(clock, raw))
        assert peeked == got[-1]
    assert (np.array(got) - got[0]).tolist() == (truth - truth[0]).tolist()
    assert got[0] == truth[0] % 2**32


def test_rows_begin_as_the_compiled_numbering_reads_them() -> None:
    for message_id in STREAMED:
        fields = DTYPES[message_id].fields
        assert fields is not None
        begin = {name: (fields[name][0].str, fields[name][1]) for name in ("seq", "t_us", "finger")}
        assert begin == {"seq": ("<u2", 0), "t_us": ("<u4", 2), "finger": ("|u1", 6)}


def test_a_status_keeps_device_time_when_nothing_streams() -> None:
    decoder = StreamDecoder()
    decoder.feed(frame(0, 0, 0))
    half_hour_us = 30 * 60 * 10**6
    for k in range(1, 10):
        decoder.feed(status(k * 30 * 60))
    assert decoder.unwrap_t_us(9 * half_hour_us % 2**32) == 9 * half_hour_us
    assert decoder.unwrap_t_us((9 * half_hour_us + 5) % 2**32) == 9 * half_hour_us + 5


@pytest.mark.parametrize("hours", [0.01, 1.0, 1.25, 4.0, 24.0])
def test_a_status_tells_who_did_not_listen_how_long_that_was(hours: float) -> None:
    """Device time wraps every 71.6 min. A row that waited in a buffer meanwhile is as old as it was."""
    decoder, seconds = StreamDecoder(), round(hours * 3600)
    decoder.feed(status(100) + frame(0, 0, 100 * 10**6))
    late_us = (101 + seconds) * 10**6
    batch = decoder.feed(frame(0, 1, 100_010_000) + status(101 + seconds) + frame(0, 100 * (1 + seconds), late_us))
    assert batch.t_us.tolist() == [100_010_000, late_us]
    assert decoder.lost == 100 * (1 + seconds) - 2
    restarted = decoder.feed(status(3) + frame(0, 300, 3 * 10**6) + status(4) + frame(0, 400, 4 * 10**6))
    assert np.diff(restarted.t_us).tolist() == [10**6]


def test_threads_cannot_share_a_decoder() -> None:
    decoder, data = StreamDecoder(), bytes(1 << 22)
    refused, fed = [], []

    def feed() -> None:
        for _ in range(20):
            try:
                fed.append(decoder.feed(data))
            except RuntimeError as error:
                refused.append(str(error))

    threads = [threading.Thread(target=feed) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(fed) + len(refused) == 160 and fed and refused
    assert set(refused) == {"another thread is feeding this decoder; give each thread its own"}
