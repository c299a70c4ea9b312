"""Export formats, by file suffix."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, imported
from ..partial_file import whole
from ..recording.reader import Recording
from .columns import Show, Table, tables, turned
from .trace import trace_tables


@dataclass(frozen=True)
class Format:
    """An export format. ``module`` is imported when needed; it may need the ``extra``."""

    module: str
    meaning: str
    extra: str = "export"


FORMATS = {
    ".csv": Format("biotac.export.csv_text", "text, one line per finger and round; PAC and bands in separate files"),
    ".parquet": Format("biotac.export.parquet", "columns for pandas and Arrow; the same files"),
    ".h5": Format("biotac.export.hdf5", "HDF5, one group per finger, one dataset per column"),
    ".mat": Format("biotac.export.mat", "MATLAB and Octave, one struct per finger: finger0.frames.force_n"),
    ".npz": Format("biotac.export.npz", "NumPy arrays named finger0/force_n"),
    ".png": Format("biotac.export.png", "a picture of force and pressure over time, with labels and gaps", "plot"),
    ".bag": Format("biotac.export.ros", "the same as a ROS 1 bag"),
    ".ros2": Format("biotac.export.ros", "a ROS 2 bag, a folder: WrenchStamped, PointStamped, counts, PAC"),
    ".mcap": Format("biotac.export.ros", "the topics of that bag in one file, for Foxglove and PlotJuggler"),
}


def export(
    recording: Recording,
    out: Path,
    *,
    overwrite: bool = False,
    frames: Mapping[int, str] | None = None,
    turns: Mapping[int, NDArray[np.float64]] | None = None,
    beside: Path | None = None,
    trace: bool = False,
    show: Show = lambda share: None,
) -> list[Path]:
    """Write ``recording`` in the format given by ``out``'s suffix; return the paths written.

    ``frames``: names of fingers' coordinate frames; ``turns``: rotations (3, 3) into them, of vectors alone, as the
    origin stays. ``beside``: a bag with more messages for the written one.
    ``trace``: the tare machine's course as well, in a flat format.

    An interrupted or failed export removes its files. Raises InputError for an unknown suffix, an extra that is
    not installed, a recording without rows, or a path that exists or cannot be written.
    """
    module = writer_for(out)
    made = [replace(table, frame=(frames or {}).get(table.finger or 0)) for table in tables(recording)]
    made = [turned(table, (turns or {}).get(table.finger or 0)) for table in made]
    if beside is not None and not hasattr(module, "BESIDE"):
        raise InputError(f"{out}: only a bag can have another bag's messages; name it .bag or .ros2")
    if trace and not module.KINDS_APART:
        raise InputError(f"{out}: a trace is a flat table; name it .csv or .parquet")
    if trace:
        made += trace_tables(recording)
    if not any(len(table) for table in made):
        raise InputError(f"{recording.path} holds no frames and no PAC; there is nothing to export")
    sources = [recording.path] if beside is None else [recording.path, beside]
    written: list[Path] = []
    with ExitStack() as together:  # no file is put in place before all are complete
        for path, part in parts(out, made, apart=module.KINDS_APART):
            more = {} if beside is None else {"beside": beside}
            target = together.enter_context(whole(path, overwrite=overwrite, sources=sources))
            module.write(target, part, recording, show, **more)
            written.append(path)
    return written


def writer_for(out: Path) -> ModuleType:
    """The module of ``out``'s format. Raises InputError for an unknown suffix, or an extra that is not installed."""
    kind = FORMATS.get(out.suffix.lower())
    if kind is None:
        raise InputError(f"{out}: unknown suffix {out.suffix!r}; expected {', '.join(FORMATS)}")
    return imported(kind.module, out.suffix, kind.extra)


def parts(out: Path, made: list[Table], *, apart: bool) -> list[tuple[Path, list[Table]]]:
    """The tables of each file. With ``apart`` (flat formats), ``a.csv`` has the frames and ``a.pac.csv`` PAC."""
    if not apart:
        return [(out, made)]
    by_kind: dict[str, list[Table]] = {}
    for table in made:
        by_kind.setdefault(table.kind, []).append(table)
    return [
        (out if kind == "frames" else out.with_suffix(f".{kind}{out.suffix}"), of_kind)
        for kind, of_kind in by_kind.items()
    ]
