"""Loading a recording's frames, or only a part of them; memory use is in proportion to that part."""

from __future__ import annotations

import os
import warnings
from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, RecordingError, RecordingWarning, printable
from ..wire.batches import StreamDecoder
from ..wire.fields import FRAME_FIELDS, Field, dtype_of, values_of
from ..wire.frames import StructArray
from . import layout
from .block import FRAME
from .blocks import ALL, Blocks

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
    seconds since the first row. What is left out takes no memory and, in recordings of format 2, little time.

    Raises RecordingError when the file is not a recording, InputError for an unknown field or finger. If the recording
    was cut off or is damaged, returns the undamaged frames and warns (RecordingWarning); Recording.problems has the
    details.
    """
    place = Path(path)
    chosen = _fields(fields)
    numbers = None if fingers is None else _fingers(place, fingers)
    wanted = {FRAME: {"t_us", *(field.sent or field.name for field in chosen)}}
    pieces = Blocks(place, wanted, numbers, check=False)
    dtype = dtype_of(chosen)
    parts, begin_us = [], None
    for piece in pieces:
        if piece.rest is None:
            return _from_wire(place, chosen, numbers, start_s, stop_s)
        if begin_us is None and piece.rest.last_us:
            begin_us = piece.rest.first_us
        if begin_us is None:
            continue
        rows = piece.rows[FRAME]
        mine = _within(rows["t_us"], begin_us, start_s, stop_s)
        rows = rows if mine.all() else rows[mine]
        out = np.empty(len(rows), dtype)
        for field in chosen:
            out[field.name] = values_of(field, rows[field.sent or field.name])
        parts.append(out)
    _checked(pieces, place)
    return np.concatenate(parts) if parts else np.empty(0, dtype)


def _from_wire(
    place: Path, chosen: list[Field], fingers: Collection[int] | None, start_s: float, stop_s: float | None
) -> StructArray:
    """Like ``load``, for a recording that stores the wire bytes as they came: decodes all of them, block by block."""
    pieces = Blocks(place, ALL, check=False)
    parts, begin_us = [], None
    for batch in _batches(pieces):
        if begin_us is None:
            begin_us = batch.first_t_us()
        if begin_us is None:
            continue
        mine = _within(batch.t_us, begin_us, start_s, stop_s)
        if fingers is not None:
            mine &= np.isin(batch.wire["finger"], list(fingers))
        out = np.empty(int(mine.sum()), dtype_of(chosen))
        sent = batch.wire[mine]
        for field in chosen:
            raw = {"seq": batch.seq[mine], "t_us": batch.t_us[mine]}.get(field.name)
            out[field.name] = values_of(field, sent[field.sent or field.name]) if raw is None else raw
        parts.append(out)
    _checked(pieces, place)
    return np.concatenate(parts) if parts else np.empty(0, dtype_of(chosen))


def _batches(pieces: Blocks) -> Iterator[Any]:
    decoder = StreamDecoder()
    decoder.accept_newer_minor()
    for piece in pieces:
        yield decoder.feed(piece.bytes())


def _fields(names: Iterable[str] | None) -> list[Field]:
    chosen = list(_BY_NAME) if names is None else [names] if isinstance(names, str) else list(names)
    unknown = [name for name in chosen if name not in _BY_NAME]
    if unknown:
        raise InputError(f"unknown field {unknown[0]!r}: expected one or more of {', '.join(_BY_NAME)}")
    return [field for field in FRAME_FIELDS if field.name in chosen]


def _fingers(place: Path, fingers: Iterable[int | str]) -> set[int]:
    wanted = {fingers} if isinstance(fingers, (int, str)) else set(fingers)
    names: dict[str, int] = {}
    if any(isinstance(finger, str) for finger in wanted):
        pieces = Blocks(place, {}, (), check=False)
        for _ in pieces:
            break
        try:
            names = layout.names_of(pieces.metadata or {})
        except (TypeError, ValueError, AttributeError, RecursionError, OverflowError) as error:
            raise RecordingError(f"{place} has damaged metadata ({error}); name its fingers by number") from error
    try:
        return {layout.finger_of(finger, names) for finger in wanted}
    except KeyError as error:
        raise InputError(f"{place}: {error.args[0]}") from None


def _within(t_us: NDArray[Any], begin_us: int, start_s: float, stop_s: float | None) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = t_us >= begin_us + start_s * 1e6
    return inside if stop_s is None else inside & (t_us < begin_us + stop_s * 1e6)


def _checked(pieces: Blocks, place: Path) -> None:
    if pieces.metadata is None:
        raise RecordingError(f"{place} holds no readable biotac recording; expected a file written by `biotac record`")
    layout.check_version(place, pieces.metadata)
    problems = pieces.scan.problems
    if problems:
        more = f", and {len(problems) - 1} more: see Recording(...).problems" if len(problems) > 1 else ""
        warnings.warn(printable(f"{problems[0]}{more}"), RecordingWarning, stacklevel=3)
