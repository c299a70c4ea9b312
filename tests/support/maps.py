"""Wrench maps to move about: blobs that the board takes, each told from the others by the bytes."""

import random
import struct

from biotac.wire import map_gen as _map

AXES = 6


def make_map(number: int, *, serial: str = "", blocks: int = 3, axes: int = AXES) -> bytes:
    """An offset and three blocks of 19 signals, then their pairs and conductances'; the first ``blocks``, up to BIG."""
    gates = list(_map.Gate)
    kinds = [(_map.Kind.OFFSET, _map.Gate.ONE), *((_map.Kind.SIGNAL, gate) for gate in gates[:3])]
    kinds += [(_map.Kind.SIGNAL_PAIRS, gate) for gate in gates] + [(_map.Kind.CONDUCTANCE_PAIRS, g) for g in gates[:2]]
    kinds = kinds[:blocks]
    head = struct.pack("<BBBB16sI4H", _map.VERSION, axes, len(kinds), 0, serial.encode(), number, 300, 24, 200, 8)
    exponents = bytes(8 if axis < axes else 0 for axis in range(_map.EXPONENTS))
    rows = b"".join(bytes([kind, gate]) + exponents for kind, gate in kinds)
    numbers = random.Random(number)
    parts = [head, rows]
    for kind, _ in kinds:
        spec = _map.KINDS[kind]
        for width in (3, axes - 3):
            coefficients = [numbers.randrange(-2000, 2001) for _ in range(width * spec.columns)]
            coefficients += [0] * (width * (spec.halves - spec.columns))
            parts.append(struct.pack(f"<{len(coefficients)}h", *coefficients))
    return b"".join(parts)


BIG = 12  # blocks: nearly 19 KiB
