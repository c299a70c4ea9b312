"""Wrench maps to move about: blobs that the board takes, each of which tells by its bytes which it is."""

from __future__ import annotations

import random
import struct

from biotac.wire import map_gen as _map

AXES = 6


def make_map(number: int, *, serial: str = "", blocks: int = 3, axes: int = AXES) -> bytes:
    """An offset and three blocks of 19 signals, then four of their pairs; the first ``blocks`` of these, up to BIG."""
    gates = list(_map.Gate)
    kinds = [(_map.Kind.OFFSET, _map.Gate.ONE), *((_map.Kind.SIGNAL, gate) for gate in gates[:3])]
    kinds = [*kinds, *((_map.Kind.SIGNAL_PAIRS, gate) for gate in gates[:4])][:blocks]
    head = struct.pack("<BBBB16sI", _map.VERSION, axes, len(kinds), 0, serial.encode(), number)
    rows = b"".join(struct.pack(f"<BB{_map.EXPONENTS}x", kind, gate) for kind, gate in kinds)
    numbers = random.Random(number)
    count = axes * sum(_map.KINDS[kind].columns for kind, _ in kinds)
    return head + rows + struct.pack(f"<{count}i", *(numbers.randrange(-(2**20), 2**20) for _ in range(count)))


BIG = 8  # blocks: over 19 KiB
