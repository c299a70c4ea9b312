"""The tape the C simulator reads: exact bytes, and refusals in words."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest

from biotac.errors import InputError
from biotac.sim import tape
from biotac.sim.source import Source


def small() -> Source:
    samples = (np.arange(3 * 2 * 44) % 4096).astype(np.uint16).reshape(3, 2, 44)
    samples[0, 1, 5:12] = tape.CODES
    return Source(name="small", samples=samples)


def test_bytes_are_those_of_the_format(tmp_path: Path) -> None:
    path = tmp_path / "a.tape"
    tape.write_tape(path, small())
    data = path.read_bytes()
    assert data[:24] == b"BTTAPE01" + struct.pack("<IIII", 2, 3, 44, 0)
    assert len(data) == 24 + 2 * 3 * 2 * 44
    # frame 0, finger 0 begins with 0, 1; finger 1 of frame 0 is next, at 44
    assert data[24:28] == b"\x00\x00\x01\x00"
    assert data[24 + 88 : 24 + 90] == struct.pack("<H", 44)
    assert data[24 + 88 + 10 : 24 + 88 + 24] == bytes.fromhex("ffff feff fdff fcff fbff faff f9ff")


def test_codes_are_those_of_the_c_simulator() -> None:
    codes = (tape.NO_CHANNEL, tape.BAD_PARITY, tape.STUCK_LOW, tape.STUCK_HIGH, tape.ERROR_WORD)
    assert (*codes, tape.UNPLUGGED, tape.SWAPPED) == (0xFFFF, 0xFFFE, 0xFFFD, 0xFFFC, 0xFFFB, 0xFFFA, 0xFFF9)


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.tape"
    tape.write_tape(path, small())
    read = tape.read_tape(path)
    assert read.dtype == np.uint16
    np.testing.assert_array_equal(read, small().samples)


def damaged(data: bytes, at: int, new: bytes) -> bytes:
    return data[:at] + new + data[at + len(new) :]


@pytest.mark.parametrize(
    ("damage", "words"),
    [
        (lambda d: b"", "expected a tape"),
        (lambda d: damaged(d, 7, b"2"), "BTTAPE02"),
        (lambda d: d[:-1], "551 bytes: expected 552"),
        (lambda d: d + b"\0", "553 bytes: expected 552"),
        (lambda d: damaged(d, 16, b"\x36"), "54 slots"),
        (lambda d: damaged(d, 20, b"\x01"), "reserved 1"),
        (lambda d: damaged(d, 12, b"\x00")[:24], "0 frames"),
        (lambda d: damaged(d, 24 + 2 * 3, b"\x00\x10"), "frame 0, finger 0, slot 3 holds 4096"),
        (lambda d: damaged(d, 24 + 2 * 47, b"\xf8\xff"), "frame 0, finger 1, slot 3 holds 65528"),
    ],
)
def test_a_damaged_tape_is_refused(tmp_path: Path, damage: object, words: str) -> None:
    path = tmp_path / "a.tape"
    tape.write_tape(path, small())
    path.write_bytes(damage(path.read_bytes()))  # type: ignore[operator]
    with pytest.raises(InputError) as caught:
        tape.read_tape(path)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_missing_tape_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot read the tape"):
        tape.read_tape(tmp_path / "none.tape")


@pytest.mark.parametrize(
    "samples",
    [
        np.zeros((3, 44), dtype=np.uint16),
        np.zeros((3, 1, 43), dtype=np.uint16),
        np.zeros((3, 1, 44), dtype=np.int16),
        np.zeros((0, 1, 44), dtype=np.uint16),
        np.zeros((3, 6, 44), dtype=np.uint16),
        np.full((3, 1, 44), 4096, dtype=np.uint16),
    ],
)
def test_what_is_no_tape_is_not_written(tmp_path: Path, samples: np.ndarray) -> None:
    path = tmp_path / "a.tape"
    with pytest.raises(InputError, match="expected"):
        tape.write_tape(path, Source(name="wrong", samples=samples))
    assert not path.exists()


def test_a_tape_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot write the tape"):
        tape.write_tape(tmp_path / "none" / "a.tape", small())
