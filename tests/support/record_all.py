"""Recordings of all that a simulated board plays, or of given bytes."""

import itertools
from collections.abc import Iterable, Mapping
from pathlib import Path

import biotac
from biotac.recording.layout import CHECKSUM
from biotac.recording.mcap_file import RecordingFile
from biotac.wire.decoder import packed, pairs


def record_all(source: str, path: Path) -> Path:
    """Record all that a simulated board plays; returns ``path``."""
    with biotac.open(source) as hand:
        hand.record(path)
        hand.read_batch(100)
    return path


def blocks_of(recording: biotac.Recording) -> list[bytes]:
    """The packets of each block."""
    numbers = range(len(recording.arrived_ns))
    return [packed(recording.messages_in(k)) for k in numbers]


def in_blocks(path: Path, blocks: int) -> Path:
    """The recording at ``path``, as if its rows had come slowly: in so many blocks."""
    whole = biotac.Recording(path)
    every = [pair for block in blocks_of(whole) for pair in pairs(block)]
    cuts = [len(every) * k // blocks for k in range(blocks + 1)]
    ns = int(whole.arrived_ns[0])
    parts = [(packed(every[a:b]), ns + k * 10**9) for k, (a, b) in enumerate(itertools.pairwise(cuts))]
    return written(path, whole.metadata, parts)


def written(
    path: Path,
    metadata: Mapping[str, str],
    blocks: Iterable[tuple[bytes, int]],
    rejected: Mapping[int, Mapping[str, int]] | None = None,
) -> Path:
    """``path``, with ``blocks`` of packets and when each arrived, Unix ns; ``rejected`` by the block's number."""
    with path.open("wb") as stream:
        file = RecordingFile(stream, {key: value for key, value in metadata.items() if key != CHECKSUM})
        for k, (packets, arrived_ns) in enumerate(blocks):
            file.add(packets, arrived_ns, rejected=(rejected or {}).get(k))
        file.close()
    return path
