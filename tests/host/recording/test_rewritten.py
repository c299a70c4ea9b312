"""Recordings that other MCAP tools wrote again: all rows, or words that say what was done to the file."""

from __future__ import annotations

from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from record_all import record_all

import biotac


def again(sources: list[Path], out: Path, *, metadata: bool = True, chunk_size: int = 1 << 20) -> Path:
    """With all topics in one chunk after the other; of size 0, without chunks."""
    with out.open("wb") as stream:
        writer = Writer(stream, chunk_size=chunk_size, use_chunking=chunk_size > 0)
        writer.start()
        channels: dict[str, int] = {}
        for source in sources:
            with source.open("rb") as read:
                reader = make_reader(read)
                for record in reader.iter_metadata() if metadata else ():
                    writer.add_metadata(record.name, record.metadata)
                for schema, channel, m in reader.iter_messages():
                    if channel.topic not in channels:
                        schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                        to = writer.register_channel(channel.topic, channel.message_encoding, schema_id)
                        channels[channel.topic] = to
                    writer.add_message(channels[channel.topic], m.log_time, m.data, m.publish_time, m.sequence)
        writer.finish()
    return out


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
