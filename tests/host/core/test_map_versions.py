"""Maps of version 1, as boards kept them up to wire 1.4: 32-bit coefficients, pairs row by row."""

from __future__ import annotations

import base64
import json
import struct
import zlib
from pathlib import Path

import numpy as np
import pytest

import biotac
from biotac.core.map_columns import Signals, kinds
from biotac.core.map_versions import current, opened
from biotac.errors import InputError
from biotac.keep import map_file
from biotac.wire.map_gen import Gate, Kind

TARE = np.full(19, 2900.0)


def version_1(blocks: list[tuple[Kind, int, np.ndarray]], axes: int = 3) -> bytes:
    """Coefficients (columns, axes) as integers of 2^-16 of the factor's unit, over 2^-exponent."""
    head = struct.pack("<BBBB16sI", 1, axes, len(blocks), 0, b"BTEMU00000000042", 1763731310)
    rows = b"".join(struct.pack("<BB", k, Gate.ONE) + bytes([e] * axes + [0] * (10 - axes)) for k, e, _ in blocks)
    body = b""
    for _, _, values in blocks:
        for start in range(0, axes, 3):
            for value in values[:, start : start + 3].ravel().tolist():
                low = (value + 0x8000) % 0x10000 - 0x8000
                body += struct.pack("<hh", low, (value - low) // 0x10000)
    return head + rows + body


def drawn(axes: int) -> list[tuple[Kind, int, np.ndarray]]:
    rng = np.random.default_rng(4)
    return [
        (Kind.OFFSET, 8, rng.integers(-(2**24), 2**24, (1, axes))),
        (Kind.SIGNAL, 7, rng.integers(-(2**21), 2**21, (19, axes))),
        (Kind.CONDUCTANCE, 10, rng.integers(-(2**22), 2**22, (19, axes))),
        (Kind.SIGNAL_PAIRS, 9, rng.integers(-(2**22), 2**22, (190, axes))),
    ]


@pytest.mark.parametrize("axes", [3, 6, 7])
def test_it_means_the_same_as_a_map_of_today(axes: int) -> None:
    blocks = drawn(axes)
    its = opened(version_1(blocks, axes))
    assert (its.axes, its.serial, its.made_s) == (axes, "BTEMU00000000042", 1763731310)
    rng = np.random.default_rng(5)
    counts = np.clip(TARE + rng.normal(-150.0, 120.0, (300, 19)), 0, 4095).astype(np.uint16)
    columns = kinds(Signals(counts - TARE, TARE))
    # SPEC.md of wire 1.4: factors 2^15 for 1, sixteenths of a count, 2^-14 of a conductance; sums in 2^-16
    factor = {Kind.OFFSET: 2.0**15, Kind.SIGNAL: 8000.0, Kind.CONDUCTANCE: 2.0**14, Kind.SIGNAL_PAIRS: 8000.0**2}
    meant = sum(
        columns[kind] @ values * factor[kind] * 2.0 ** (exponent - 32 - 16 * (kind == Kind.SIGNAL_PAIRS))
        for kind, exponent, values in blocks
    )
    tare_q4 = np.tile((16 * TARE).astype(np.uint16), (300, 1))
    got = np.column_stack(its.results(counts, tare_q4, np.zeros(300, np.int32))[:1])
    off = got[:, :3] - np.asarray(meant)[:, :3]
    assert np.sqrt((off**2).mean(axis=0)).max() < 100.0  # 10 mN
    assert np.abs(meant).max() > 20000.0  # of some newtons


def test_files_and_what_takes_maps_load_it(tmp_path: Path) -> None:
    blob = version_1(drawn(3))
    facts = {"format": map_file.FORMAT, "version": 1, "serial": "BTEMU00000000042", "made_s": 1763731310}
    facts |= {"bytes": len(blob), "crc32": f"{zlib.crc32(blob):08x}", "map": base64.b64encode(blob).decode()}
    path = tmp_path / "old.json"
    path.write_text(json.dumps(facts))
    assert map_file.load(path) == opened(blob).blob == current(blob)
    assert current(current(blob)) == current(blob)
    result = biotac.compute(np.full((1, 19), 2800), TARE, wrench_map=blob)
    assert np.isfinite(result["force_n"]).all()


def test_what_is_cut_or_changed_is_refused_in_words() -> None:
    blob = version_1(drawn(3))
    for bad in (blob[:10], blob[:-4], blob + b"\0\0\0\0", blob[:24] + b"\x40" + blob[25:], blob[:1] + b"\5" + blob[2:]):
        with pytest.raises(InputError, match=r"of version 1 and \d+ bytes cannot be read .*; calibrate"):
            current(bad)
