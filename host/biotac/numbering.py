"""Counters of the wire as int64: wraps undone, gaps found. Arrays in, arrays out."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FINGERS = 256  # what a message's finger byte can say, sensible or not
# A live link brings a few messages at a time; so many are done one by one in less time than one pass of NumPy's takes.
FEW = 24


def nearest(raw: int, near: int, bits: int = 32) -> int:
    """The value that a wrapping counter shows as ``raw``, of all such the one nearest to ``near``."""
    half, mask = 1 << (bits - 1), (1 << bits) - 1
    return near + ((raw - near + half) & mask) - half


class Unwrapper:
    """Extends a wrapping counter to int64, each value to the nearest after the one before."""

    def __init__(self, bits: int) -> None:
        self._half = 1 << (bits - 1)
        self._mask = (1 << bits) - 1
        self._last: int | None = None

    def extend(self, values: NDArray[Any]) -> NDArray[np.int64]:
        """Return the unwrapped values; steps back stay steps back."""
        if 0 < len(values) <= FEW:
            return np.array(self._extend_few(values.tolist()), np.int64)
        out = values.astype(np.int64)
        if not len(out):
            return out
        first = int(out[0]) if self._last is None else self._last
        out[1:] -= out[:-1].copy()
        out[0] -= first
        # Steps, the nearest way round; the first one from where the last call ended.
        out += self._half
        out &= self._mask
        out -= self._half
        out[0] += first
        np.cumsum(out, out=out)
        self._last = int(out[-1])
        return out

    def _extend_few(self, values: list[int]) -> list[int]:
        half, mask = self._half, self._mask
        last = values[0] if self._last is None else self._last
        out = []
        for value in values:
            last += ((value - last + half) & mask) - half
            out.append(last)
        self._last = last
        return out


class Numbering:
    """Sequence numbers of one kind of message, 16 bits on the wire, for all fingers at once.

    ``lost`` counts what the numbers say was made and never came, ``gaps`` says where: (finger, number before
    the gap, how many). ``disordered`` counts numbers that repeat or step back.
    """

    def __init__(self) -> None:
        self.lost = 0
        self.disordered = 0
        self.gaps: list[tuple[int, int, int]] = []
        self._last = np.zeros(FINGERS, np.int64)
        self._seen = np.zeros(FINGERS, np.bool_)
        self._joined = np.zeros(FINGERS, np.bool_)  # its next number is expected to follow its last one

    def rejoin(self) -> None:
        """Whatever numbers come next, nothing was lost before them."""
        self._joined[:] = False

    def extend(self, finger: NDArray[Any], seq: NDArray[Any], rounds: NDArray[np.int64] | int) -> NDArray[np.int64]:
        """Return ``seq`` (n,) unwrapped, each finger for itself. A message stands for ``rounds`` numbers up to its
        own.
        """
        n = len(seq)
        if not n:
            return np.empty(0, np.int64)
        if n <= FEW:
            each = rounds.tolist() if isinstance(rounds, np.ndarray) else [rounds] * n
            return np.array(self._extend_few(finger.tolist(), seq.tolist(), each), np.int64)
        # Finger by finger, each in order of arrival: one pass serves them all.
        order = np.argsort(finger, kind="stable")
        who = finger[order]
        raw = seq[order].astype(np.int64)
        starts = np.concatenate(([0], np.flatnonzero(who[1:] != who[:-1]) + 1))
        fingers = who[starts]

        before = np.empty(n, np.int64)
        before[1:] = raw[:-1]
        before[starts] = np.where(self._seen[fingers], self._last[fingers], raw[starts])
        steps = ((raw - before + 0x8000) & 0xFFFF) - 0x8000
        total = np.cumsum(steps)
        lengths = np.diff(starts, append=n)
        out: NDArray[np.int64] = total + np.repeat(before[starts] - total[starts] + steps[starts], lengths)

        first = out - (rounds[order] if isinstance(rounds, np.ndarray) else rounds) + 1
        expected = np.empty(n, np.int64)
        expected[1:] = out[:-1] + 1
        expected[starts] = np.where(self._joined[fingers], self._last[fingers] + 1, first[starts])
        missing = first - expected
        if missing.any():
            self._count(who, expected, missing)

        self._last[fingers] = out[starts + lengths - 1]
        self._seen[fingers] = self._joined[fingers] = True
        in_order = np.empty(n, np.int64)
        in_order[order] = out
        return in_order

    def _extend_few(self, finger: list[int], seq: list[int], rounds: list[int]) -> list[int]:
        last: dict[int, int] = {}
        expected: dict[int, int] = {}
        out = []
        for who, raw, count in zip(finger, seq, rounds, strict=True):
            before = last.get(who)
            if before is None:
                before = int(self._last[who]) if self._seen[who] else raw
                if self._joined[who]:
                    expected[who] = before + 1
            number = before + ((raw - before + 0x8000) & 0xFFFF) - 0x8000
            first = number - count + 1
            missing = first - expected.get(who, first)
            if missing < 0:
                self.disordered += 1
            elif missing:
                self.lost += missing
                self.gaps.append((who, first - missing - 1, missing))
            last[who] = number
            expected[who] = number + 1
            out.append(number)
        for who, number in last.items():
            self._last[who] = number
            self._seen[who] = self._joined[who] = True
        return out

    def _count(self, finger: NDArray[Any], expected: NDArray[np.int64], missing: NDArray[np.int64]) -> None:
        self.disordered += int(np.count_nonzero(missing < 0))
        at = np.flatnonzero(missing > 0)
        self.lost += int(missing[at].sum())
        self.gaps += zip(finger[at].tolist(), (expected[at] - 1).tolist(), missing[at].tolist(), strict=True)
