"""The wire's wrapping counters. Those of a stream are handled in host/binding/decode/numbering.c."""

from __future__ import annotations


def nearest(raw: int, near: int) -> int:
    """Of all values that a counter of 32 bits shows as ``raw``, the one nearest to ``near``."""
    return near + (raw - near + 2**31) % 2**32 - 2**31
