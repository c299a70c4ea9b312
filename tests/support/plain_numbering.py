"""Sequence numbers of one kind of message, unwrapped and counted in Python's whole numbers and sets: an oracle."""

from __future__ import annotations


class Loop:
    """What the compiled numbering answers to: one number at a time, in Python's whole numbers and sets."""

    def __init__(self) -> None:
        self.last: dict[int, int] = {}
        self.missing: dict[int, set[int]] = {}
        self.joined: set[int] = set()
        self.gaps: list[tuple[int, int, int]] = []
        self.disordered = 0
        self.lost = 0

    def extend(self, finger: int, seq: int, rounds: int) -> int:
        last = self.last.get(finger, seq)
        whole = min((last - last % 65536 + seq + k * 65536 for k in (-1, 0, 1)), key=lambda v: (abs(v - last), v))
        lacking = self.missing.setdefault(finger, set())
        covered = set(range(whole - rounds + 1, whole + 1))
        if finger not in self.joined or whole <= last - 64:
            self.disordered += finger in self.joined
            lacking.clear()
        elif whole <= last:
            late = {number for number in lacking & covered if number > last - 64}
            lacking -= late
            self.lost -= len(late)
            self.disordered += 1
            return whole
        else:
            new = set(range(last + 1, whole + 1)) - covered
            lacking |= new
            self.lost += len(new)
            self.disordered += whole - rounds < last
            if new:
                self.gaps.append((finger, last, len(new)))
        self.last[finger] = whole
        self.joined.add(finger)
        return whole
