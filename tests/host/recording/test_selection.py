"""Parts of a recording, and recordings of format 1: the same numbers as from all of it, in less memory."""

from __future__ import annotations

import gzip
import hashlib
import json
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from record_all import record_all

import biotac
from biotac.recording import layout
from biotac.wire.framing import encode

OLD = Path(__file__).parents[2] / "data" / "recordings"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    return record_all("sim:press.toml?fingers=5&seconds=20", tmp_path_factory.mktemp("parts") / "a.mcap")


@pytest.fixture(scope="module")
def old(tmp_path_factory) -> Path:
    """0.3 s of sim:press.toml?fingers=2, recorded by the library of commit ca7096c."""
    path = tmp_path_factory.mktemp("old") / "format1.mcap"
    path.write_bytes(gzip.decompress((OLD / "format1.mcap.gz").read_bytes()))
    return path


def same(rows: np.ndarray, wanted: np.ndarray) -> None:
    assert rows.dtype == wanted.dtype
    for name in rows.dtype.names or ():
        np.testing.assert_array_equal(rows[name], wanted[name])


def digest(values: np.ndarray) -> str:
    return hashlib.sha256(np.ascontiguousarray(values).tobytes()).hexdigest()[:16]


def test_an_old_recording_loads_as_it_did(old: Path) -> None:
    """The digests are those of the arrays that the library of then gave."""
    then = json.loads((OLD / "format1.json").read_text())
    recording = biotac.Recording(old)
    assert recording.problems == [] and recording.metadata["format"] == "1"
    assert hashlib.sha256(b"".join(recording.blocks)).hexdigest()[:16] == then["blocks"]
    assert (len(recording.frames), recording.begin_ns) == (then["rows"], then["begin_ns"])
    for kind in ("frames", "pac", "idle", "wire"):
        rows = getattr(recording, kind)
        assert {name: digest(rows[name]) for name in then[kind]} == then[kind]
    same(biotac.load(old), recording.frames)


def test_a_part_is_what_all_has_there(recorded: Path, old: Path) -> None:
    for path in (recorded, old):
        full = biotac.load(path)
        same(full, biotac.Recording(path).frames)
        since_s = (full["t_us"] - full["t_us"].min()) / 1e6
        part = biotac.load(path, fields=["force_n", "t_us", "tare"], fingers=[1], start_s=0.1, stop_s=3.5)
        wanted = full[(full["finger"] == 1) & (since_s >= 0.1) & (since_s < 3.5)]
        assert part.dtype.names == ("t_us", "tare", "force_n") and len(part) > 15
        for name in part.dtype.names:
            np.testing.assert_array_equal(part[name], wanted[name])


def test_one_fingers_force_takes_little_memory(recorded: Path) -> None:
    def peak(**part: object) -> int:
        biotac.load(recorded, **part)  # type: ignore[arg-type]
        tracemalloc.start()
        biotac.load(recorded, **part)  # type: ignore[arg-type]
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    assert peak(fields=["t_us", "force_n"], fingers=[2]) <= 0.15 * peak()


def test_what_is_not_there_is_named(recorded: Path, tmp_path: Path) -> None:
    with pytest.raises(biotac.InputError, match="unknown field 'forces_n': expected one or more of finger, seq"):
        biotac.load(recorded, fields=["forces_n"])
    with pytest.raises(biotac.InputError, match="no finger 'nose'"):
        biotac.load(recorded, fingers=["nose"])
    with pytest.raises(biotac.RecordingError):
        biotac.load(tmp_path / "none.mcap")


def test_a_damaged_second_is_kept_as_it_came(recorded: Path, tmp_path: Path) -> None:
    """To the byte, whatever was on the line; and its rows come with the others."""
    from biotac.recording.file import RecordingFile

    whole = biotac.Recording(recorded)
    blocks = list(whole.blocks)
    blocks[1] = b"noise\0" + blocks[1]
    blocks[3] += encode(0x7F, b"of a version to come")
    with (tmp_path / "noisy.mcap").open("wb") as stream:
        file = RecordingFile(stream, whole.metadata)
        for block, arrived_ns in zip(blocks, whole.arrived_ns, strict=True):
            file.add(block, arrived_ns)
        file.close()
    noisy = biotac.Recording(tmp_path / "noisy.mcap")
    assert b"".join(noisy.blocks) == b"".join(blocks)
    same(noisy.frames, whole.frames)
    same(biotac.load(tmp_path / "noisy.mcap"), whole.frames)


@pytest.mark.parametrize("told", [True, False])
def test_a_bomb_is_refused_before_it_unpacks(recorded: Path, tmp_path: Path, told: bool) -> None:
    bomb = tmp_path / "bomb.mcap"
    with bomb.open("wb") as stream:
        writer = Writer(stream, chunk_size=1, compression=CompressionType.ZSTD)
        writer.start()
        schema = writer.register_schema(layout.SCHEMA_NAME, layout.SCHEMA_ENCODING, b"")
        channel = writer.register_channel(layout.TOPIC, layout.MESSAGE_ENCODING, schema)
        writer.add_metadata(layout.METADATA_NAME, biotac.Recording(recorded).metadata)
        for k in range(3):
            writer.add_message(channel, k, bytes(200_000_000), k)
        writer.finish()
    data = bomb.read_bytes()
    assert len(data) < 200_000
    if not told:  # the chunk says another size than its zstd frame
        at = data.index((200_000_000 + 31).to_bytes(8, "little"))
        bomb.write_bytes(data[:at] + (1000).to_bytes(8, "little") + data[at + 8 :])
    tracemalloc.start()
    with pytest.raises(biotac.RecordingError, match="unpacks to"):
        biotac.Recording(bomb)
    assert tracemalloc.get_traced_memory()[1] < 20e6
    tracemalloc.stop()
