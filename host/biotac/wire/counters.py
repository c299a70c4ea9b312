"""Counters of the wire, which wrap. Those of a stream are host/binding/numbering.c's."""

from __future__ import annotations


def nearest(raw: int, near: int, bits: int = 32) -> int:
    """The value that a wrapping counter shows as ``raw``, of all such the one nearest to ``near``."""
    half, mask = 1 << (bits - 1), (1 << bits) - 1
    return near + ((raw - near + half) & mask) - half
