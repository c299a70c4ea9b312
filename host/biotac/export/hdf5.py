"""HDF5: ``/finger0/frames/force_n`` and so on, one dataset per column; opens in h5py and MATLAB.

Octave opens it, too, unless a label is beyond ASCII.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from ..recording.reader import Recording
from .columns import Show, Table

KINDS_APART = False


def write(path: Path, made: list[Table], recording: Recording, show: Show) -> None:
    """Write the file. Units and meanings are attributes of the datasets, frame_id of the groups, metadata of the file.

    The file is built in memory and written by Python: on a full disk, HDF5 itself crashes the process (SIGSEGV while
    closing).
    """
    with h5py.File(path.name, "w", driver="core", backing_store=False, block_size=1 << 22) as file:
        file.attrs.update(recording.metadata)
        for k, table in enumerate(made):
            group = file.create_group(f"finger{table.finger}/{table.kind}")
            group.attrs["frame_id"] = table.frame_id
            for column in table.columns:
                values = table.arrays[column.name]
                if values.dtype.kind == "U":
                    texts = np.char.encode(values, "utf-8")  # Octave's load ends at text of other kinds
                    kind = "ascii" if all(map(str.isascii, np.unique(values).tolist())) else "utf-8"
                    values = texts.astype(h5py.string_dtype(kind, max(1, texts.dtype.itemsize)))
                data = group.create_dataset(column.name, data=values, compression="gzip", shuffle=True)
                data.attrs["unit"] = column.unit
                data.attrs["what"] = column.what
                if column.parts:
                    data.attrs["parts"] = list(column.parts)
            show((k + 1) / len(made))
        file.flush()
        path.write_bytes(file.id.get_file_image())
