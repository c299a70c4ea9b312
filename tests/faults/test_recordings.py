"""One flipped bit in a recording: each is reported, or changes nothing that the library gives."""

import random
import struct
import warnings
from collections import Counter
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import MCAP0_MAGIC
from record_all import blocks_of, in_blocks, record_all

import biotac

HEAD = struct.Struct("<BQ")  # opcode and length, of every MCAP record
CHUNK, DATA_END = 0x06, 0x0F
CHUNK_HEAD_BYTES = 50  # the chunk's own checksum does not cover these


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = record_all("sim:press.toml?seconds=0.6", tmp_path_factory.mktemp("recorded") / "rec.mcap")
    return in_blocks(path, 3).read_bytes()


def content(path: Path) -> tuple[dict[str, Any], list[str]]:
    """All data of a Recording, and the problems."""
    found = biotac.Recording(path)
    names = [
        "settings", "calibrations", "maps", "names", "info", "sensors", "metadata", "arrived_ns", "messages", "counts",
        "frames_lost",
    ]  # fmt: skip
    facts = {name: getattr(found, name) for name in names} | {
        name: getattr(found, name).tobytes() for name in ("frames", "pac", "idle", "wire")
    }
    return facts | {"blocks": blocks_of(found), "gaps": found.gaps, "arrivals": found.all_here_ns}, found.problems


def loaded(path: Path) -> tuple[bytes, bool]:
    """The result of ``load``, and whether it warned."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        return biotac.load(path).tobytes(), bool(caught)


def records(data: bytes) -> list[tuple[int, int, int]]:
    """Opcode, begin and end of every record."""
    out, at = [], 8
    while at < len(data) - 8:
        opcode, length = HEAD.unpack_from(data, at)
        out.append((opcode, at, at + HEAD.size + length))
        at = out[-1][2]
    return out


def outcome(path: Path, good: tuple[dict[str, Any], bytes]) -> str:
    """``told`` or ``silent`` where something is another, else ``harmless``."""
    try:
        facts, problems = content(path)
        rows, warned = loaded(path)
    except biotac.RecordingError:
        return "told"
    if (facts != good[0] and not problems) or (rows != good[1] and not warned):
        return "silent"
    return "told" if problems else "harmless"


def tried(tmp_path: Path, recorded: bytes, bits: list[int]) -> Counter[str]:
    path = tmp_path / "rec.mcap"
    path.write_bytes(recorded)
    facts, problems = content(path)
    rows, warned = loaded(path)
    assert not problems and not warned
    counts: Counter[str] = Counter()
    for bit in bits:
        spoilt = bytearray(recorded)
        spoilt[bit // 8] ^= 1 << bit % 8
        path.write_bytes(spoilt)
        found = outcome(path, (facts, rows))
        assert found != "silent", f"bit {bit % 8} of byte {bit // 8}"
        counts[found] += 1
    return counts


def structure(data: bytes) -> list[int]:
    """Every byte that no chunk's own checksum is over."""
    kept: list[int] = []
    for opcode, begin, end in records(data):
        kept += range(begin, min(end, begin + CHUNK_HEAD_BYTES) if opcode == CHUNK else end)
    return kept


def test_a_flipped_bit_is_told(tmp_path: Path, recorded: bytes) -> None:
    """Drawn from all of the file, one in the head of every record, and all of the file's last bytes."""
    draw = random.Random(17)
    bits = [8 * begin + draw.randrange(8 * HEAD.size) for _, begin, _ in records(recorded)]
    bits += [8 * byte + draw.randrange(8) for byte in draw.sample(structure(recorded), 60)]
    bits += [draw.randrange(8 * len(recorded)) for _ in range(60)]
    bits += [8 * byte + draw.randrange(8) for byte in range(len(recorded) - len(MCAP0_MAGIC), len(recorded))]
    counts = tried(tmp_path, recorded, bits)
    assert counts["harmless"] == 0


@pytest.mark.nightly
def test_every_byte_of_the_structure_is_told(tmp_path: Path, recorded: bytes) -> None:
    draw = random.Random(18)
    tried(tmp_path, recorded, [8 * byte + draw.randrange(8) for byte in structure(recorded)])


def test_a_block_that_is_cut_out_is_told(tmp_path: Path, recorded: bytes) -> None:
    """Whole records gone, lengths right: only the checksums and statistics know."""
    path = tmp_path / "rec.mcap"
    path.write_bytes(recorded)
    good = content(path)[0], loaded(path)[0]
    until = next(begin for opcode, begin, _ in records(recorded) if opcode == DATA_END)
    for _, begin, end in records(recorded):
        if begin < until:
            path.write_bytes(recorded[:begin] + recorded[end:])
            assert outcome(path, good) == "told"


def test_records_that_changed_places_or_came_twice_are_told(tmp_path: Path, recorded: bytes) -> None:
    """Every one of them whole: the chunk's checksum knows nothing, and a partial load skips the file's."""
    path, draw = tmp_path / "rec.mcap", random.Random(19)
    path.write_bytes(recorded)
    good = content(path)[0], loaded(path)[0]
    found = [recorded[begin:end] for _, begin, end in records(recorded)]
    until = next(k for k, (opcode, *_) in enumerate(records(recorded)) if opcode == DATA_END)
    for _ in range(60):
        order, one, other = list(found), draw.randrange(until), draw.randrange(until)
        if draw.random() < 0.5:
            order[one], order[other] = order[other], order[one]
        else:
            order.insert(other, order[one])
        path.write_bytes(recorded[:8] + b"".join(order) + recorded[-8:])
        assert outcome(path, good) != "silent", (one, other)
