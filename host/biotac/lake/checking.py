"""Checking a lake's recording against its seal, and its results against the float64 reference."""

from __future__ import annotations

import hashlib
import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from ..errors import InputError
from ..keep.calibration import own_settings
from ..recording.crosscheck import CrossCheck
from ..recording.facts import Facts
from ..wire.fields import FRAME_FIELDS
from ..wire.frames import FRAME_DTYPE, StructArray, frames_to_wire
from .folder import RECORDINGS, place
from .writing import DIGEST, digest_of


@dataclass(frozen=True)
class Checked:
    """Result of a check. ``wrong``, in words: files that differ from the seal, and out-of-bounds results."""

    outcome: CrossCheck
    wrong: list[str]


def check(lake: str, topics: dict[str, set[str]], partition: dict[str, str], recording: str) -> Checked:
    """Check all files of ``recording``; ``topics`` and ``partition`` are the lake's.

    Raises InputError for a damaged seal.
    """
    folder = Path(lake)
    seal = place(folder, RECORDINGS, partition[recording], recording)
    try:
        data = seal.read_bytes()
        digest = pq.read_metadata(io.BytesIO(data)).metadata[DIGEST]
        if digest != digest_of(data, digest):
            raise ValueError("its digest does not match")
        row: dict[str, Any] = pq.read_table(io.BytesIO(data)).to_pylist()[0]
        if row["recording"] != recording:
            raise ValueError(f"it belongs to {row['recording']}")
        facts = Facts.read(dict(row["metadata"]))
        files = {its["topic"]: its for its in row["files"]}
    except (pa.ArrowException, OSError, ValueError, LookupError, TypeError, AttributeError) as error:
        raise InputError(f"{seal} is damaged ({error}); export its recording again with --force") from error
    wrong = []
    outcome = CrossCheck()
    for topic in sorted({*files, *(topic for topic, its in topics.items() if recording in its)} - {RECORDINGS}):
        path = place(folder, topic, partition[recording], recording)
        told = files.get(topic)
        if told is None:
            wrong.append(f"{path} is not listed in its seal; move it elsewhere")
            continue
        try:
            data = path.read_bytes()
        except OSError as error:
            wrong.append(f"{path} cannot be read ({error.strerror}); export {row['source']} again with --force")
            continue
        if hashlib.sha256(data).hexdigest() != told["sha256"]:
            wrong.append(f"{path} differs from what was exported; export {row['source']} again with --force")
        elif topic == "frames":
            rows = frames_of(pq.read_table(io.BytesIO(data)))
            own = own_settings(facts.settings, facts.calibrations)
            outcome.add(frames_to_wire(rows), facts.settings, own, facts.maps)
    wrong += [f"{recording} ({row['source']}): {finding}" for finding in outcome.findings]
    return Checked(outcome, wrong)


def frames_of(table: pa.Table) -> StructArray:
    """The topic ``frames`` as FRAME_DTYPE (n,), with null turned into the fields' invalid values."""
    out = np.empty(table.num_rows, FRAME_DTYPE)
    for field in FRAME_FIELDS:
        values = [_numbers(table[name], field.invalid) for name in field.flat_names()]
        out[field.name] = np.column_stack(values) if field.parts else values[0]
    return out


def _numbers(column: pa.ChunkedArray, invalid: int | None) -> Any:
    if column.null_count and pa.types.is_integer(column.type):
        column = pc.fill_null(column, invalid)
    return column.to_numpy()
