"""Recordings to look at: of all that a simulated board plays, or of given bytes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

import biotac
from biotac.recording.layout import CHECKSUM
from biotac.recording.mcap_file import RecordingFile
from biotac.wire.framing import encode


def record_all(source: str, path: Path) -> Path:
    """Record all that a simulated board plays; returns ``path``."""
    with biotac.open(source) as hand:
        hand.record(path)
        hand.read_batch(100)
    return path


def blocks_of(recording: biotac.Recording) -> list[bytes]:
    """The messages of each block, as a board sends them."""
    numbers = range(len(recording.arrived_ns))
    return [b"".join(encode(*message) for message in recording.messages_in(k)) for k in numbers]


def written(path: Path, metadata: Mapping[str, str], blocks: Iterable[tuple[bytes, int]]) -> Path:
    """``path``, with ``blocks`` of the wire and when each arrived, Unix ns."""
    with path.open("wb") as stream:
        file = RecordingFile(stream, {key: value for key, value in metadata.items() if key != CHECKSUM})
        for data, arrived_ns in blocks:
            file.add(data, arrived_ns)
        file.close()
    return path
