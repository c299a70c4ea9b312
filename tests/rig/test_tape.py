"""The tape that emulated sensors read: exact bytes, and refusals in words."""

import struct
from pathlib import Path

import numpy as np
import pytest

from biotac.errors import InputError
from biotac.sim.source import CODES, Source
from biotac_rig import tape


def small() -> Source:
    samples = (np.arange(3 * 2 * 44) % 4096).astype(np.uint16).reshape(3, 2, 44)
    samples[0, 1, 5:12] = CODES
    return Source(name="small", samples=samples)


def test_bytes_are_those_of_the_format(tmp_path: Path) -> None:
    path = tmp_path / "a.tape"
    tape.write_tape(path, small())
    data = path.read_bytes()
    assert data[:24] == b"BTTAPE02" + struct.pack("<IIII", 2, 3, 44, 0)
    assert len(data) == 24 + 2 * 3 * 2 * 44
    # slot 0 of frame 0: finger 0 has 0, finger 1 has 44; slot 1 is next
    assert data[24:32] == struct.pack("<4H", 0, 44, 1, 45)
    slot = struct.iter_unpack("<2H", data[24 + 4 * 5 : 24 + 4 * 12])
    assert [finger_1 for _, finger_1 in slot] == [0xFFF9, 0xFFFA, 0xFFFB, 0xFFFC, 0xFFFD, 0xFFFE, 0xFFFF]


@pytest.mark.parametrize(
    ("samples", "words"),
    [
        (np.zeros((3, 1, 43), dtype=np.uint16), "expected uint16"),
        (np.zeros((3, 1, 44), dtype=np.int16), "samples are int16"),
        (np.full((3, 1, 44), 4096, dtype=np.uint16), "frame 0, finger 0, slot 0 holds 4096"),
    ],
)
def test_what_is_no_tape_is_not_written(tmp_path: Path, samples: np.ndarray, words: str) -> None:
    path = tmp_path / "a.tape"
    with pytest.raises(InputError, match=words):
        tape.write_tape(path, Source(name="wrong", samples=samples))
    assert not path.exists()


def test_a_tape_that_cannot_be_written_says_so(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot write the tape"):
        tape.write_tape(tmp_path / "none" / "a.tape", small())
