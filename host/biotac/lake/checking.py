"""Checking a lake's recording against the lake's checksums, and its results against the float64 reference."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from ..keep.calibration import own_settings
from ..recording.crosscheck import CrossCheck
from ..recording.facts import Facts
from ..wire import messages_gen as wire
from ..wire.dtypes_gen import DTYPES
from ..wire.fields import FRAME_FIELDS, sent_of
from ..wire.frames import StructArray
from .folder import RECORDINGS


@dataclass(frozen=True)
class Checked:
    """``wrong``, in words: files that differ from what was exported, and out-of-bounds results."""

    outcome: CrossCheck = field(default_factory=CrossCheck)
    wrong: list[str] = field(default_factory=list)


def check(lake: str, item: tuple[str, dict[str, str]]) -> Checked:
    """Check a recording: its id, and SHA-256 by path of its files. Nothing that differs is opened as Parquet."""
    recording, sums = item
    checked = Checked()
    tables: dict[str, pa.Table] = {}
    for path, sha256 in sums.items():
        file, topic = Path(lake) / path, path.partition("/")[0]
        try:
            data = file.read_bytes() if file.is_file() else None  # reading a FIFO would not return
        except OSError as error:
            checked.wrong.append(f"{file} cannot be read ({error.strerror}); export it again with --force")
            continue
        if data is None:
            checked.wrong.append(f"{file} is missing, or no file; export it again with --force")
        elif hashlib.sha256(data).hexdigest() != sha256:
            checked.wrong.append(f"{file} differs from what was exported; export it again with --force")
        elif topic in (RECORDINGS, "frames"):
            # In Arrow's memory: its threads may outlive the program's end, and one that then lets go of a Python
            # object aborts it.
            copy = pa.BufferOutputStream()
            copy.write(data)
            tables[topic] = pq.read_table(pa.BufferReader(copy.getvalue()))
    if not any(path.startswith(f"{RECORDINGS}/") for path in sums):
        checked.wrong.append(f"{recording} has no file in {RECORDINGS}; export it again with --force")
    if len(tables) == 2:
        row = tables[RECORDINGS].to_pylist()[0]
        try:
            facts = Facts.read(dict(row["metadata"]))
            frames = messages_of(tables["frames"])
        except (KeyError, ValueError) as error:  # another version's: the checksums say that it is as it was exported
            checked.wrong.append(
                f"{recording} ({row['source']}): another version of biotac-gateway wrote it ({error}); "
                "export it again with --force"
            )
            return checked
        own = own_settings(facts.settings, facts.calibrations)
        checked.outcome.add(frames, facts.settings, own, facts.maps)
        checked.wrong.extend(f"{recording} ({row['source']}): {finding}" for finding in checked.outcome.findings)
    return checked


def messages_of(table: pa.Table) -> StructArray:
    """The FRAME messages (n,) from which the topic ``frames`` was made, to the bit."""
    out = np.zeros(table.num_rows, DTYPES[wire.Frame.ID])
    for column in FRAME_FIELDS:
        parts = [_numbers(table[name], column.invalid) for name in column.flat_names()]
        values = np.column_stack(parts) if column.parts else parts[0]
        name = column.sent or column.name
        if not column.sent:
            values = values & np.iinfo(out.dtype[name]).max  # the wire's counters wrap
        out[name] = sent_of(column, values, out.dtype[name].base)
    return out


def _numbers(column: pa.ChunkedArray, invalid: int | None) -> Any:
    if column.null_count and pa.types.is_integer(column.type):
        column = pc.fill_null(column, invalid)
    return column.to_numpy()
