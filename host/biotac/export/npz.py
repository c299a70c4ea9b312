"""NPZ: arrays ``finger0/frames/force_n`` and so on, and ``columns``, JSON that describes them."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..recording.reader import Recording
from .columns import Show, Table, described

KINDS_APART = False


def write(path: Path, made: list[Table], recording: Recording, show: Show) -> None:
    """Write the file as numpy.savez_compressed would, but array by array, in order to report progress."""
    about = {
        "metadata": recording.metadata,
        **{kind: [asdict(column) for column in columns] for kind, columns in described(made).items()},
        "frame_id": {f"finger{table.finger}": table.frame_id for table in made},
    }
    arrays: dict[str, NDArray[Any]] = {"columns": np.array(json.dumps(about))}
    for table in made:
        arrays |= {f"finger{table.finger}/{table.kind}/{name}": values for name, values in table.arrays.items()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for k, (name, values) in enumerate(arrays.items()):
            buffer = io.BytesIO()
            np.save(buffer, values)
            archive.writestr(f"{name}.npy", buffer.getvalue())
            show((k + 1) / len(arrays))
