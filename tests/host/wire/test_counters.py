"""Unwrapped numbers and counted gaps (host/binding/decode/numbering.c), against a loop over one message at a time."""

from __future__ import annotations

import numpy as np
from plain_numbering import Loop

from biotac.wire import messages_gen as wire
from biotac.wire.batches import StreamDecoder
from biotac.wire.framing import encode
from biotac.wire.native import ffi, lib


def numbers(random: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fingers at random; their numbers go on, skip, repeat, step back and start over."""
    finger = random.choice(np.array([0, 1, 4, 200], np.uint8), n)
    rounds = random.choice([1, 1, 1, 2, 10], n)
    at = dict.fromkeys(range(256), 65_000)
    seq = np.empty(n, "<u2")
    for k, (who, step) in enumerate(zip(finger.tolist(), rounds.tolist(), strict=True)):
        step += int(random.choice([0, 0, 0, 0, 0, 0, 0, 3, -1, -2, -3, -20, -70, 9_000, 32_000, -32_000]))
        at[who] = (at[who] + step) % 65536
        seq[k] = at[who]
    return finger, seq, rounds


def test_numbers_go_on_and_gaps_are_found_as_in_whole_numbers() -> None:
    random = np.random.default_rng(1)
    compiled, loop = ffi.new("bt_numbering *"), Loop()
    lib.bt_numbering_reset(compiled)
    gap, gaps = ffi.new("bt_gap *"), []
    for finger, seq, rounds in zip(*(column.tolist() for column in numbers(random, 12_000)), strict=True):
        assert lib.bt_number(compiled, finger, seq, rounds, 0, gap) == loop.extend(finger, seq, rounds)
        if gap.missing:
            gaps.append((gap.finger, gap.before, gap.missing))
        if random.random() < 0.05:
            lib.bt_numbering_rejoin(compiled)
            loop.joined.clear()
    assert gaps == loop.gaps
    assert compiled.lost == loop.lost
    assert compiled.disordered == loop.disordered
    assert len(gaps) > 100 and loop.disordered > 100


def test_a_swap_and_a_repetition_lose_nothing() -> None:
    compiled = ffi.new("bt_numbering *")
    lib.bt_numbering_reset(compiled)
    for seq in (1, 2, 4, 3, 3, 5, 6, 6, 7):
        lib.bt_number(compiled, 0, seq, 1, 0, ffi.NULL)
    assert (compiled.lost, compiled.disordered) == (0, 3)


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
