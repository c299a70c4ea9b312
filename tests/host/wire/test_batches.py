"""Sequence numbers, device time and losses across wraps, gaps and fingers."""

from __future__ import annotations

import threading

import live_board
import numpy as np
import pytest

from biotac.wire import messages_gen as wire
from biotac.wire.batches import StreamDecoder
from biotac.wire.decoder import ONE_STEP_BYTES, STREAMED
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
    assert np.isnan(batches[0].taken_s)  # nobody knows when: these bytes came from no board


@pytest.mark.parametrize("missing", [0, 1, 2, 3])
def test_a_lost_heartbeat_or_frame_among_heartbeats_is_a_loss(missing: int) -> None:
    sent = [(frame(1, 9, 0), 0), (idle(1, 19, 0, 10), 10), (idle(1, 24, 0, 5), 5), (frame(1, 25, 0), 1)]
    sent.append((frame(1, 26, 0), 1))
    decoder = StreamDecoder()
    for k, (message, _) in enumerate(sent):
        if k != missing:
            decoder.feed(message)
    assert decoder.lost == sent[missing][1]


def test_sequence_and_time_are_unwrapped_for_each_finger() -> None:
    decoder = StreamDecoder()
    sent = [(f, 65530 + k, 2**32 - 30_000 + 10_000 * k) for k in range(12) for f in (0, 3)]
    frames = np.concatenate([decoder.feed(frame(*s)).frames for s in sent])
    for finger in (0, 3):
        own = frames[frames["finger"] == finger]
        assert own["seq"].tolist() == list(range(65530, 65542))
        assert np.all(np.diff(own["t_us"]) == 10_000)
    assert decoder.lost == 0
    assert StreamDecoder().feed(b"".join(frame(*s) for s in sent * (ONE_STEP_BYTES // 2000))).fingers == 0b1001


@pytest.mark.parametrize("at_once", [True, False])
def test_a_gap_is_counted_and_placed(at_once: bool) -> None:
    decoder = StreamDecoder()
    parts = [frame(1, seq, 10_000 * seq) for seq in (65533, 65534, 65539, 65540)]
    for chunk in [b"".join(parts)] if at_once else parts:
        decoder.feed(chunk)
    assert decoder.lost == 4
    assert decoder.lost_after == [(1, 65534, 4)]


def test_a_damaged_frame_is_lost_and_counted_and_the_next_one_is_not() -> None:
    decoder = StreamDecoder()
    good = [frame(0, seq, 10_000 * seq) for seq in range(3)]
    broken = bytearray(good[1])
    broken[20] ^= 0x40
    got = decoder.feed(good[0] + bytes(broken) + good[2]).frames
    assert got["seq"].tolist() == [0, 2]
    assert (decoder.lost, decoder.counts.bad) == (1, 1)


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


def test_frames_made_while_nobody_listened_are_not_lost() -> None:
    decoder = StreamDecoder()
    started = encode(wire.Reply.ID, wire.Reply(9, wire.Start.ID, 0).pack())
    batch = decoder.feed(frame(0, 5, 0) + started + frame(0, 900, 9_000_000) + frame(0, 902, 9_020_000))
    assert batch.frames["seq"].tolist() == [5, 900, 902]
    assert decoder.lost_after == [(0, 900, 1)]


@pytest.mark.parametrize(("seqs", "lost", "disordered"), [((1, 2, 2, 3, 5), 1, 1), ((1, 2, 4, 3, 3, 5, 6, 6, 7), 0, 3)])
def test_a_repeated_frame_is_no_gain_and_hides_no_loss(seqs: tuple[int, ...], lost: int, disordered: int) -> None:
    decoder = StreamDecoder()
    decoder.feed(b"".join(frame(0, seq, 10_000 * seq) for seq in seqs))
    assert (decoder.lost, decoder.disordered) == (lost, disordered)


def test_a_reboot_is_no_loss_of_sixty_thousand_frames() -> None:
    decoder = StreamDecoder()
    seq = decoder.feed(b"".join(frame(0, s, 10_000 * s) for s in (500, 501, 0, 1))).frames["seq"]
    assert (decoder.lost, decoder.disordered) == (0, 1)
    assert seq[-1] - seq[-2] == 1


def test_a_finger_that_is_plugged_in_late_has_the_boards_time() -> None:
    decoder = StreamDecoder()
    decoder.feed(frame(0, 0, 2**32 - 5_000))
    later = decoder.feed(frame(0, 1, 2**32 + 5_000) + frame(1, 0, 2**32 + 5_100)).frames
    assert (later["t_us"] - 2**32).tolist() == [5_000, 5_100]


def test_lost_pac_blocks_are_counted_apart() -> None:
    decoder = StreamDecoder()
    blocks = [wire.Pac(seq, 10_000 * seq, 0, (2000,) * 22) for seq in (0, 1, 4)]
    decoder.feed(b"".join(encode(wire.Pac.ID, b.pack()) for b in blocks) + frame(0, 0, 0))
    assert (decoder.lost, decoder.lost_pac) == (0, 2)


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
    """Device time wraps every 71.6 min. What waited in a buffer meanwhile is as old as it was."""
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
