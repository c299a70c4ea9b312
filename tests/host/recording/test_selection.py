"""Parts of a recording: the same numbers as from all of it, in less memory."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer
from record_all import blocks_of, record_all, written

import biotac
from biotac.recording import layout
from biotac.wire.decoder import packed


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    return record_all("sim:press.toml?fingers=5&seconds=20", tmp_path_factory.mktemp("parts") / "a.mcap")


def same(rows: np.ndarray, wanted: np.ndarray) -> None:
    assert rows.dtype == wanted.dtype
    for name in rows.dtype.names or ():
        np.testing.assert_array_equal(rows[name], wanted[name])


def test_a_part_is_what_all_has_there(recorded: Path) -> None:
    full = biotac.load(recorded)
    same(full, biotac.Recording(recorded).frames)
    since_s = (full["t_us"] - full["t_us"].min()) / 1e6
    part = biotac.load(recorded, fields=["force_n", "t_us", "tare"], fingers=[1], start_s=0.1, stop_s=3.5)
    wanted = full[(full["finger"] == 1) & (since_s >= 0.1) & (since_s < 3.5)]
    assert part.dtype.names == ("t_us", "tare", "force_n") and len(part) > 15
    for name in part.dtype.names:
        np.testing.assert_array_equal(part[name], wanted[name])


def test_what_is_not_there_is_named(recorded: Path, tmp_path: Path) -> None:
    with pytest.raises(biotac.InputError, match="unknown field 'forces_n': expected one or more of finger, seq"):
        biotac.load(recorded, fields=["forces_n"])
    with pytest.raises(biotac.InputError, match="no finger 'nose'"):
        biotac.load(recorded, fingers=["nose"])
    with pytest.raises(biotac.RecordingError):
        biotac.load(tmp_path / "none.mcap")


def test_noise_is_counted_and_messages_of_a_version_to_come_are_kept(recorded: Path, tmp_path: Path) -> None:
    whole = biotac.Recording(recorded)
    blocks = blocks_of(whole)
    blocks[3] += packed([(0x7F, b"of a version to come")])
    times = zip(blocks, whole.arrived_ns, strict=True)
    path = written(tmp_path / "noisy.mcap", whole.metadata, times, {1: {"bad_cobs": 1}})
    noisy = biotac.Recording(path)
    assert [k for k, head in enumerate(noisy.heads()) if head.head.rejected] == [1] and noisy.counts.bad == 1
    assert [*noisy.messages_in(3)][-1] == (0x7F, b"of a version to come")
    same(noisy.frames, whole.frames)
    same(biotac.load(path), whole.frames)


@pytest.mark.parametrize("size_is_true", [True, False])
def test_a_bomb_is_refused_before_it_unpacks(recorded: Path, tmp_path: Path, size_is_true: bool) -> None:
    bomb = tmp_path / "bomb.mcap"
    with bomb.open("wb") as stream:
        writer = Writer(stream, chunk_size=1, compression=CompressionType.ZSTD)
        writer.start()
        schema = writer.register_schema(layout.WIRE_SCHEMA, layout.WIRE_SCHEMA_ENCODING, b"")
        channel = writer.register_channel(layout.HEAD, layout.ENCODINGS[layout.HEAD], schema)
        writer.add_metadata(layout.METADATA_NAME, biotac.Recording(recorded).metadata)
        for k in range(2):  # the first one's chunk has the channel too
            writer.add_message(channel, k, bytes(200_000_000), k)
        writer.finish()
    data = bomb.read_bytes()
    assert len(data) < 200_000
    if not size_is_true:  # the chunk and the zstd frame state different sizes
        at = data.index((200_000_000 + 31).to_bytes(8, "little"))
        bomb.write_bytes(data[:at] + (1000).to_bytes(8, "little") + data[at + 8 :])
    tracemalloc.start()
    with pytest.raises(biotac.RecordingError, match="unpacks to"):
        biotac.Recording(bomb)
    assert tracemalloc.get_traced_memory()[1] < 20e6
    tracemalloc.stop()
