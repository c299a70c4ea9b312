"""Loading a recording's frames, or only a part of them; memory use is in proportion to that part."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ..errors import InputError, RecordingError, RecordingWarning, printable
from ..wire.fields import FRAME_FIELDS, Field, dtype_of, values_of
from ..wire.frames import StructArray
from . import layout
from .block import FRAME
from .blocks import Blocks

_BY_NAME = {field.name: field for field in FRAME_FIELDS}


def load(
    path: str | os.PathLike[str],
    *,
    fields: Iterable[str] | None = None,
    fingers: Iterable[int | str] | None = None,
    start_s: float = 0.0,
    stop_s: float | None = None,
) -> StructArray:
    """Return a recording's frames in order of arrival: FRAME_DTYPE (n,), or only its ``fields`` named, in its order.

    ``fingers`` are chip selects or recorded names. ``start_s`` (inclusive) and ``stop_s`` (exclusive) are device
    seconds since the first row. What is left out takes no memory and little time.

    Raises RecordingError when the file is not a recording, InputError for an unknown field or finger. If the recording
    has gaps, was cut off or is damaged, returns the undamaged frames and warns (RecordingWarning); Recording.problems
    has the details.
    """
    path = Path(path)
    chosen = _fields(fields)
    numbers = None if fingers is None else _fingers(path, fingers)
    wanted = {FRAME: {"t_us", *(field.sent or field.name for field in chosen)}}
    blocks = Blocks(path, wanted, numbers, check=False)
    dtype = dtype_of(chosen)
    parts = [np.empty(0, dtype)]
    begin_us: int | None = None
    gaps = 0
    for block in blocks:
        gaps += len(block.rest.gaps)
        begin_us = block.rest.first_us if begin_us is None else begin_us
        if begin_us is None:
            continue
        rows = block.rows[FRAME]
        inside = rows["t_us"] >= begin_us + start_s * 1e6
        if stop_s is not None:
            inside &= rows["t_us"] < begin_us + stop_s * 1e6
        rows = rows if inside.all() else rows[inside]
        out = np.empty(len(rows), dtype)
        for field in chosen:
            out[field.name] = values_of(field, rows[field.sent or field.name])
        parts.append(out)
    _check(blocks, path, gaps)
    return np.concatenate(parts)


def _fields(names: Iterable[str] | None) -> list[Field]:
    chosen = list(_BY_NAME) if names is None else [names] if isinstance(names, str) else list(names)
    unknown = [name for name in chosen if name not in _BY_NAME]
    if unknown:
        raise InputError(f"unknown field {unknown[0]!r}: expected one or more of {', '.join(_BY_NAME)}")
    return [field for field in FRAME_FIELDS if field.name in chosen]


def _fingers(path: Path, fingers: Iterable[int | str]) -> set[int]:
    wanted = {fingers} if isinstance(fingers, (int, str)) else set(fingers)
    names: dict[str, int] = {}
    if any(isinstance(finger, str) for finger in wanted):
        blocks = Blocks(path, {}, (), check=False)
        next(iter(blocks), None)
        try:
            names = layout.names_of(blocks.metadata or {})
        except (TypeError, ValueError, AttributeError, RecursionError, OverflowError) as error:
            raise RecordingError(f"{path} has damaged metadata ({error}); name its fingers by number") from error
    try:
        return {layout.finger_of(finger, names) for finger in wanted}
    except KeyError as error:
        raise InputError(f"{path}: {error.args[0]}") from None


def _check(blocks: Blocks, path: Path, gaps: int) -> None:
    if blocks.metadata is None:
        raise RecordingError(f"{path} holds no readable biotac recording; expected a file written by `biotac record`")
    layout.check_version(path, blocks.metadata)
    problems = list(blocks.scan.problems)
    if gaps:
        problems.append(f"{path.name} has {gaps} gap(s): see Recording(...).gaps")
    if problems:
        more = f", and {len(problems) - 1} more: see Recording(...).problems" if len(problems) > 1 else ""
        warnings.warn(printable(f"{problems[0]}{more}"), RecordingWarning, stacklevel=3)
