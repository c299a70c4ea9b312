"""Reading maps as boards stored them up to wire 1.4 (version 1), and converting them to the current version.

Coefficients had 32 bits, with x, y and z of a column side by side and torsion's after them; pairs came row by row.
Rounded to 16 bits, a map gives the same results within some mN.
"""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from ..wire import map_gen as _map
from ..wire.map_gen import Gate, Kind
from . import map_quantise
from .board_map import BLOCK, HEADER, BoardMap, from_blob
from .map_columns import AXES, PRESSURE_COUNTS, SIGNAL_COUNTS

VERSION = 1
# The factor that stood for 1 in a column of features; its product with a coefficient was divided by 2^16.
_FACTOR = {"one": 2.0**15, "signal": 16 * SIGNAL_COUNTS, "conductance": 2.0**14, "pressure": 16 * PRESSURE_COUNTS}


def current(blob: bytes) -> bytes:
    """``blob`` itself, or one of version 1 converted to the current version. Raises InputError if that fails."""
    if blob[:1] != bytes([VERSION]):
        return blob
    try:
        return _read(blob).blob
    except (ValueError, ArithmeticError) as error:
        raise InputError(
            f"a wrench map of version {VERSION} and {len(blob)} bytes cannot be read ({error}): expected one "
            f"written by `biotac map get`; calibrate the finger again"
        ) from error


def opened(its: BoardMap | bytes) -> BoardMap:
    """The map itself, or the one in a blob of any version. Raises InputError when a board would refuse the blob."""
    return its if isinstance(its, BoardMap) else from_blob(current(its))


def _read(blob: bytes) -> BoardMap:
    if len(blob) < _map.HEADER_BYTES:
        raise ValueError("its header is cut off")
    _, axes, count, _, serial, made_s = HEADER.unpack_from(blob)
    at = _map.HEADER_BYTES + count * _map.BLOCK_BYTES
    if axes not in (_map.AXES_FORCE, _map.AXES_TORQUE, _map.AXES_TORSION) or len(blob) < at:
        raise ValueError(f"its header claims {axes} axes and {count} blocks")
    blocks = []
    for k in range(count):
        kind_value, gate_value, *exponent = BLOCK.unpack_from(blob, _map.HEADER_BYTES + k * _map.BLOCK_BYTES)
        kind, gate = Kind(kind_value), Gate(gate_value)
        spec = _map.KINDS[kind]
        words = np.frombuffer(blob, "<i2", 2 * spec.columns * axes, at).astype(np.int64).reshape(-1, 2)
        groups = np.split(words[:, 1] * 65536 + words[:, 0], [3 * spec.columns, 6 * spec.columns])
        values = np.concatenate([g.reshape(spec.columns, -1) for g in groups if len(g)], axis=1)
        factor = (_FACTOR[spec.of] / 2.0**16) ** (2 if spec.shape == "pairs" else 1)
        real = values * factor * 2.0 ** (np.array(exponent[:axes]) - 16.0)
        blocks.append(map_quantise.block(kind, gate, real, AXES[:axes]))
        at += 4 * spec.columns * axes
    if at != len(blob):
        raise ValueError(f"it has {len(blob)} bytes, its header says {at}")
    return BoardMap(axes, tuple(blocks), serial.rstrip(b"\0").decode("ascii", "replace"), made_s)
