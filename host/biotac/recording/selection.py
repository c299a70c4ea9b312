"""Loading a recording's frames, or only a part of them; memory use is in proportion to that part."""

from __future__ import annotations

import math
import os
import warnings
from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import numpy as np

from ..errors import InputError, RecordingError, RecordingWarning, printable
from ..wire.fields import FRAME_FIELDS, Field, dtype_of, values_of
from ..wire.frames import StructArray
from . import layout
from .block import FRAME
from .blocks import Blocks
from .index import Index

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
    chosen = fields_named(fields)
    rows, blocks, gaps = part_of(path, Index.read(path), chosen, fingers, start_s, stop_s)
    _check(blocks, path, gaps)
    return rows


def part_of(
    path: Path,
    index: Index | None,
    chosen: list[Field],
    fingers: Iterable[int | str] | None,
    start_s: float = 0.0,
    stop_s: float | None = None,
) -> tuple[StructArray, Blocks, int]:
    """The rows that ``load`` gives, what was read for them, and how many gaps that has."""
    numbers = None if fingers is None else _fingers(path, fingers)
    wanted = {FRAME: {"t_us", *(field.sent or field.name for field in chosen)}}
    begin_us: int | None = None
    only = range(0)
    if index is not None:
        begin_us, only = _within(path, index, start_s, stop_s)
    blocks = Blocks(path, wanted, numbers, check=False, index=index, only=only)
    dtype = dtype_of(chosen)
    parts = [np.empty(0, dtype)]
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
    return np.concatenate(parts), blocks, gaps


def _within(path: Path, index: Index, start_s: float, stop_s: float | None) -> tuple[int | None, range]:
    """Device time of the first row, and the blocks that can have rows between these times: a few of them are read."""
    count = len(index.blocks)

    @cache
    def first_us(block: int) -> float:
        """Of this block, or else of the next that has rows."""
        for found in Blocks(path, {}, (), check=False, index=index, only=range(block, count)):
            if found.rest.first_us is not None:
                return found.rest.first_us
        return math.inf

    if not count or math.isinf(first_us(0)):
        return None, range(count)
    begin_us = first_us(0)
    # One block more: rows that came out of order may lie beyond their neighbours.
    begin = bisect_right(range(count), begin_us + start_s * 1e6, key=first_us) - 2 if start_s > 0 else 0
    end = count if stop_s is None else bisect_left(range(count), begin_us + stop_s * 1e6, key=first_us) + 1
    return int(begin_us), range(max(0, begin), min(count, end))


def fields_named(names: Iterable[str] | None) -> list[Field]:
    """Fields in the order of rows, all for None. Raises InputError for an unknown one."""
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
