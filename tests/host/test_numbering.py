"""Unwrapped numbers and counted gaps, against a plain loop over one message at a time."""

from __future__ import annotations

import numpy as np
import pytest

from biotac.numbering import Numbering, Unwrapper


class Loop:
    """What Numbering answers to: one number at a time, in Python's whole numbers."""

    def __init__(self) -> None:
        self.last: dict[int, int] = {}
        self.joined: set[int] = set()
        self.gaps: list[tuple[int, int, int]] = []
        self.disordered = 0

    def extend(self, finger: int, seq: int, rounds: int) -> int:
        last = self.last.get(finger, seq)
        whole = min((last - last % 65536 + seq + k * 65536 for k in (-1, 0, 1)), key=lambda v: (abs(v - last), v))
        if finger in self.joined:
            missing = whole - rounds - last
            if missing > 0:
                self.gaps.append((finger, last, missing))
            self.disordered += missing < 0
        self.last[finger] = whole
        self.joined.add(finger)
        return whole


def numbers(random: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fingers at random; their numbers go on, skip, repeat, step back and start over."""
    finger = random.choice(np.array([0, 1, 4, 200], np.uint8), n)
    rounds = random.choice([1, 1, 1, 2, 10], n)
    at = dict.fromkeys(range(256), 65_000)
    seq = np.empty(n, "<u2")
    for k, (who, step) in enumerate(zip(finger.tolist(), rounds.tolist(), strict=True)):
        step += int(random.choice([0, 0, 0, 0, 0, 0, 0, 3, -1, -20, 9_000, 32_000, -32_000]))
        at[who] = (at[who] + step) % 65536
        seq[k] = at[who]
    return finger, seq, rounds


@pytest.mark.parametrize("longest", [1, 7, 400])
def test_any_batches_number_and_count_as_one_message_at_a_time(longest: int) -> None:
    random = np.random.default_rng(longest)
    finger, seq, rounds = numbers(random, 4000)
    many, one = Numbering(), Loop()
    at = 0
    while at < len(seq):
        part = slice(at, at + int(random.integers(1, longest + 1)))
        got = many.extend(finger[part], seq[part], rounds[part])
        want = [one.extend(*map(int, each)) for each in zip(finger[part], seq[part], rounds[part], strict=True)]
        assert got.tolist() == want
        at = part.stop
        if random.random() < 0.05:
            many.rejoin()
            one.joined.clear()
    assert sorted(many.gaps) == sorted(one.gaps)
    assert many.lost == sum(lost for *_, lost in one.gaps)
    assert many.disordered == one.disordered
    assert len(one.gaps) > 100 and one.disordered > 100


def test_without_messages_nothing_happens() -> None:
    numbering = Numbering()
    empty = np.empty(0, np.uint8)
    assert len(numbering.extend(empty, empty, 1)) == 0
    assert (numbering.lost, numbering.disordered, numbering.gaps) == (0, 0, [])


@pytest.mark.parametrize("longest", [1, 5, 1000])
def test_device_time_goes_on_over_its_wraps_in_any_batches(longest: int) -> None:
    random = np.random.default_rng(longest)
    truth = 2**32 - 10**6 + np.cumsum(random.integers(-1000, 2**30, 1000))
    clock = Unwrapper(32)
    at, got = 0, []
    while at < len(truth):
        size = int(random.integers(0, longest + 1))
        got += clock.extend((truth[at : at + size] % 2**32).astype("<u4")).tolist()
        at += size
    assert (np.array(got) - got[0]).tolist() == (truth - truth[0]).tolist()
    assert got[0] == truth[0] % 2**32
