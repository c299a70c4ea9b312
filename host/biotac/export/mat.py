"""MATLAB: one struct per finger, ``finger0.frames.force_n``, and ``columns``, which describes them; also for Octave."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from scipy.io import savemat

from ..recording.reader import Recording
from .columns import Show, Table, described

KINDS_APART = False


def write(path: Path, made: list[Table], recording: Recording, show: Show) -> None:
    """Write a file of version 5. Labels are a cell array of texts."""
    fingers: dict[str, Any] = {}
    for k, table in enumerate(made):
        show(k / len(made))
        cells = {name: v.astype(object) if v.dtype.kind == "U" else v for name, v in table.arrays.items()}
        fingers.setdefault(f"finger{table.finger}", {"frame_id": table.frame_id})[table.kind] = cells
    columns = {
        kind: {c.name: {"unit": c.unit, "what": c.what, "parts": list(c.parts)} for c in fields}
        for kind, fields in described(made).items()
    }
    about = {"metadata": recording.metadata, "columns": columns}
    with path.open("wb") as file:
        savemat(file, fingers | about, do_compression=True, oned_as="column")
