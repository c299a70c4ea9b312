"""The wire's wrapping counters. Those of a stream are handled in host/binding/decode/numbering.c."""

from __future__ import annotations


def nearest(raw: int, near: int, bits: int = 32) -> int:
    """Of all values that a wrapping counter shows as ``raw``, the one nearest to ``near``."""
    half, mask = 1 << (bits - 1), (1 << bits) - 1
    return near + ((raw - near + half) & mask) - half
