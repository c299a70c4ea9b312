"""Recordings that other MCAP tools wrote again: all rows, or words that name the change to the file."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from maps import make_map
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer
from record_all import record_all

import biotac
from biotac.board.gap import Gap

ORDERS: dict[str, Callable[[Any], Any]] = {
    "time": lambda m: m[1].log_time,
    "topic": lambda m: (m[0].topic, m[1].log_time),
    "back": lambda m: -m[1].sequence,
}


def again(
    sources: list[Path],
    out: Path,
    *,
    metadata: bool = True,
    chunk_size: int = 1 << 20,
    compression: CompressionType = CompressionType.ZSTD,
    order: str = "time",
) -> Path:
    """With all topics in one chunk after the other; with size 0, without chunks."""
    with out.open("wb") as stream:
        writer = Writer(stream, chunk_size=chunk_size, use_chunking=chunk_size > 0, compression=compression)
        writer.start()
        channels: dict[str, int] = {}
        for source in sources:
            with source.open("rb") as read:
                reader = make_reader(read)
                for record in reader.iter_metadata() if metadata else ():
                    writer.add_metadata(record.name, record.metadata)
                found = [(channel, m, schema) for schema, channel, m in reader.iter_messages()]
                for channel, m, schema in sorted(found, key=ORDERS[order]):
                    if channel.topic not in channels:
                        schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                        to = writer.register_channel(channel.topic, channel.message_encoding, schema_id)
                        channels[channel.topic] = to
                    writer.add_message(channels[channel.topic], m.log_time, m.data, m.publish_time, m.sequence)
        writer.finish()
    return out


WAYS = [
    (size, compression, order)
    for size, compression in ((0, "NONE"), (10_000, "LZ4"), (64_000, "ZSTD"), (1 << 26, "NONE"))
    for order in ORDERS
]


@pytest.fixture(scope="module")
def marked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With a gap, a label of each kind, and a finger with a wrench map."""
    path = tmp_path_factory.mktemp("marked") / "a.mcap"
    with biotac.open("sim:press.toml?fingers=2&seconds=4") as hand:
        hand.board.set_map(1, make_map(1))
        with hand.record(path, note="glass") as recorder:
            hand.read_batch(1.0)
            with hand.mark("grasp", trial=3):
                hand.read_batch(1.0)
            recorder.put(replace(hand.read_batch(0.1), messages=[Gap("silence", None, None, 1, 2, 7, 3)]))
            hand.read_batch(100)
    return path


@pytest.mark.filterwarnings("ignore::biotac.RecordingWarning")
@pytest.mark.parametrize(("chunk_size", "compression", "order"), WAYS)
def test_twelve_ways_to_write_it_give_the_same(
    marked: Path, tmp_path: Path, chunk_size: int, compression: str, order: str
) -> None:
    kind = CompressionType[compression]
    path = again([marked], tmp_path / "a.mcap", chunk_size=chunk_size, compression=kind, order=order)
    before, recording = biotac.Recording(marked), biotac.Recording(path)
    assert biotac.load(path, fields=["seq", "t_us"]).tobytes() == biotac.load(marked, fields=["seq", "t_us"]).tobytes()
    assert recording.frames.tobytes() == before.frames.tobytes() and recording.pac.tobytes() == before.pac.tobytes()
    assert recording.select().rows.tobytes() == before.select().rows.tobytes()
    assert (recording.labels, recording.gaps, recording.maps) == (before.labels, before.gaps, before.maps)
    assert recording.messages == before.messages and recording.problems == before.problems and before.gaps
    assert np.array_equal(recording.applied_n, before.applied_n, equal_nan=True)


def test_all_rows_or_words(tmp_path: Path) -> None:
    first, second = (record_all("sim:press.toml?fingers=2&seconds=3", tmp_path / f"{k}.mcap") for k in "ab")
    for chunk_size in (0, 10_000, 64_000, 1 << 26):
        path = again([first], tmp_path / f"{chunk_size}.mcap", chunk_size=chunk_size)
        recording = biotac.Recording(path)
        assert len(biotac.load(path)) == len(recording.select().rows) == 600
        assert recording.end_us > recording.begin_us and recording.problems == []
    with pytest.raises(biotac.RecordingError, match="not its metadata, as `mcap filter`"):
        biotac.load(again([first], tmp_path / "none.mcap", metadata=False))
    merged = again([first, second], tmp_path / "merged.mcap")
    with pytest.warns(biotac.RecordingWarning, match="holds two recordings that were merged"):
        biotac.load(merged)
    assert len(biotac.Recording(merged).problems) == 1
