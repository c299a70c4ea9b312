"""Many recordings of one: the same rows, begun later."""

from __future__ import annotations

from pathlib import Path

import biotac
from biotac.recording.layout import CHECKSUM
from biotac.recording.mcap_file import RecordingFile


def copies(recording: biotac.Recording, folder: Path, count: int, apart_s: float) -> list[Path]:
    """``count`` recordings in ``folder``, the k-th ``k * apart_s`` later than ``recording``."""
    metadata = {key: value for key, value in recording.metadata.items() if key != CHECKSUM}
    paths = [folder / f"{k:05}.mcap" for k in range(count)]
    for k, path in enumerate(paths):
        later_ns = round(k * apart_s * 1e9)
        file = RecordingFile(path.open("xb"), metadata)
        for block, arrived_ns, here_ns in zip(
            recording.blocks, recording.arrived_ns, recording.all_here_ns, strict=True
        ):
            file.add(block, arrived_ns + later_ns, None if here_ns is None else here_ns + later_ns)
        file.close()
    return paths
