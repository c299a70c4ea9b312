"""A part of a recording, read without the rest: in rows, pandas or xarray; resampled; beside another signal."""

from __future__ import annotations

import math
import os
import warnings
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.typing import NDArray

from ..clock.alignment import ELECTRODES_S, PDC_S, Alignment, align_best, means
from ..clock.check_times import increasing, looks_like, seconds
from ..errors import InputError, RecordingError, RecordingWarning, imported, printable
from ..kernels.geometry import ELECTRODE_MM
from ..wire.fields import AXES, FRAME_FIELDS, Field, dtype_of, values_of
from ..wire.frames import StructArray, joined
from ..wire.messages_gen import INVALID_COUNT, FrameFlags
from ..wire.slots import FRAME_HZ
from . import layout
from .blocks import BlockReader
from .contents import Contents
from .scan import Index

_BY_NAME = {field.name: field for field in FRAME_FIELDS}
_LONG = 100.0  # times the selection's length: a longer signal does not belong to it, or is not in s
_OF_ROW = ("finger", "seq", "t_us")
#: The flags of a missing row: none of the values may be used.
_ABSENT = (
    FrameFlags.UNTARED | FrameFlags.POC_INVALID | FrameFlags.ELECTRODE_MISSING | FrameFlags.PDC_MISSING
    | FrameFlags.TAC_MISSING | FrameFlags.TDC_MISSING | FrameFlags.FAULT
)  # fmt: skip


def load(
    path: str | os.PathLike[str],
    *,
    fields: Iterable[str] | None = None,
    fingers: Iterable[int | str] | None = None,
    start_s: float = 0.0,
    stop_s: float | None = None,
) -> StructArray:
    """Return a recording's frames in order of arrival: FRAME_DTYPE (n,), or only the ``fields`` named, in that order.

    ``fingers`` are chip selects or recorded names. ``start_s`` (inclusive) and ``stop_s`` (exclusive) are device
    seconds since the first row. Omitted fields and rows need no memory and little time.

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
) -> tuple[StructArray, BlockReader, int]:
    """The rows that ``load`` gives, the blocks read for them, and how many gaps those have."""
    named = None if fingers is None else {fingers} if isinstance(fingers, (int, str)) else set(fingers)
    if index is not None:
        begin_us, only = _within(path, index, start_s, stop_s)
    else:
        heads = (block.head.first_us for block in BlockReader(path, rows=False, check=False))
        begin_us, only = min((first_us for first_us in heads if first_us is not None), default=None), range(0)
    blocks = BlockReader(path, named, check=False, index=index, only=only)
    dtype = dtype_of(chosen)
    parts: list[tuple[int, StructArray]] = []
    gaps = 0
    for block in blocks:
        gaps += len(block.head.gaps)
        if begin_us is None:
            continue
        batch = block.batch
        inside = batch.t_us >= begin_us + start_s * 1e6
        if stop_s is not None:
            inside &= batch.t_us < begin_us + stop_s * 1e6
        whole = bool(inside.all())
        out = np.empty(len(batch.wire) if whole else int(inside.sum()), dtype)
        for field in chosen:
            name = field.sent or field.name
            values = {"seq": batch.seq, "t_us": batch.t_us}.get(name)
            values = batch.wire[name] if values is None else values
            out[field.name] = values_of(field, values if whole else values[inside])
        parts.append((block.number, out))
    parts.sort(key=lambda part: part[0])  # another program may have put the blocks in another order
    return joined([np.empty(0, dtype), *(rows for _, rows in parts)]), blocks, gaps


def _within(path: Path, index: Index, start_s: float, stop_s: float | None) -> tuple[int | None, range]:
    """Device time of the first row, and the blocks that can have rows between these times: a few of them are read."""
    count = len(index.blocks)

    @cache
    def first_us(block: int) -> float:
        """Of this block, or else of the next that has rows."""
        for found in BlockReader(path, rows=False, check=False, index=index, only=range(block, count)):
            if found.head.first_us is not None:
                return found.head.first_us
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


def _check(blocks: BlockReader, path: Path, gaps: int) -> None:
    if blocks.metadata is None:
        Contents(path)  # raises RecordingError, which names the fault
        raise RecordingError(f"{path} holds no readable biotac recording; expected a file written by `biotac record`")
    layout.check_version(path, blocks.metadata)
    problems = list(blocks.scan.problems)
    if gaps:
        problems.append(f"{path.name} has {gaps} gap(s): see Recording(...).gaps")
    if problems:
        more = f", and {len(problems) - 1} more: see Recording(...).problems" if len(problems) > 1 else ""
        warnings.warn(printable(f"{problems[0]}{more}"), RecordingWarning, stacklevel=3)


@dataclass(frozen=True, repr=False)
class Selection:
    """Rows of a recording, made by ``Recording.select``.

    ``rows`` is a structured array (n,) in order of arrival, with ``finger``, ``seq``, ``t_us`` and the ``fields`` asked
    for. ``names`` has the fingers' names by number.
    """

    rows: StructArray
    fields: tuple[Field, ...]
    names: dict[int, str]
    label_of: Callable[[StructArray], NDArray[np.str_]]
    gap_s_of: Callable[[StructArray], NDArray[np.float32]]
    stamp_ns: Callable[[NDArray[np.int64]], NDArray[np.int64]]

    def __len__(self) -> int:
        return len(self.rows)

    def __repr__(self) -> str:
        fingers = ", ".join(self.names.get(f, str(f)) for f in np.unique(self.rows["finger"]).tolist())
        columns = ", ".join(f"{field.name} ({field.unit})" for field in self.fields if field.name not in _OF_ROW)
        return f"<biotac.Selection: {len(self)} rows of {fingers or 'no finger'}: {columns}>"

    @property
    def label(self) -> NDArray[np.str_]:
        """The labels that hold at each row (n,); the first use looks for them in the whole recording."""
        return self.label_of(self.rows)

    @property
    def gap_s(self) -> NDArray[np.float32]:
        """How long the board or the finger was away just before each row (n,), in s; 0 where it was there."""
        return self.gap_s_of(self.rows)

    def to_numpy(self) -> StructArray:
        """The rows."""
        return self.rows

    def to_pandas(self) -> Any:
        """A DataFrame with the flat names of host/docs/reference/rows.md: a row per frame, indexed by ``stamp`` (UTC).

        Integer fields that can be missing are nullable (UInt16); all others have NumPy types. ``gap_s``
        and ``label`` are the last columns. ``attrs["units"]`` has each column's unit. Needs the extra ``export``.
        """
        pandas: Any = imported("pandas", "a DataFrame", "export")
        columns: dict[str, Any] = {}
        units: dict[str, str] = {}
        for field in self.fields:
            values = self.rows[field.name].reshape(len(self), -1)
            for k, name in enumerate(field.flat_names()):
                column = values[:, k].copy()
                if field.invalid is not None:
                    column = pandas.arrays.IntegerArray(column, column == field.invalid)
                columns[name], units[name] = column, field.unit
        columns["gap_s"], units["gap_s"] = self.gap_s, "s"
        columns["label"] = pandas.Categorical(self.label)
        index = pandas.DatetimeIndex(pandas.to_datetime(self.stamp_ns(self.rows["t_us"]), utc=True), name="stamp")
        table = pandas.DataFrame(columns, index=index)
        table.attrs["units"] = units
        return table

    def to_xarray(self) -> Any:
        """A Dataset with dimensions ``time`` and ``finger``, and ``axis`` or ``electrode`` for vectors.

        ``time`` is the stamp (UTC) of a round, ``finger`` the name or else the number as text. Electrodes have their
        positions on the core as coordinates ``electrode_x_mm``, ``_y_mm`` and ``_z_mm``; variables have ``units`` and
        ``long_name``. Where a finger has no row in a round, and for missing counts, floats are NaN (float32 holds 0 to
        4095 exactly), and ``flags`` say so. Needs the extra ``export``, with SciPy for ``to_netcdf``; read back,
        ``flags`` and ``t_us`` are float64.
        """
        xarray: Any = imported("xarray", "a Dataset", "export")
        t_us, round_of = np.unique(self.rows["t_us"], return_inverse=True)
        numbers, finger_of = np.unique(self.rows["finger"], return_inverse=True)
        shape = len(t_us), len(numbers)
        texts = self.label
        label = np.full(shape, "", texts.dtype)
        label[round_of, finger_of] = texts
        gap_s = np.zeros(shape, np.float32)
        gap_s[round_of, finger_of] = self.gap_s
        coordinates: dict[str, Any] = {
            "time": self.stamp_ns(t_us).astype("datetime64[ns]"),
            "finger": [self.names.get(finger, str(finger)) for finger in numbers.tolist()],
            "t_us": ("time", t_us),
            "label": (("time", "finger"), label),
            "gap_s": (("time", "finger"), gap_s, {"units": "s"}),
        }
        data: dict[str, Any] = {}
        for field in self.fields:
            values = self.rows[field.name]
            if field.name in ("finger", "t_us"):
                continue
            if field.invalid is not None:
                values = np.where(values == field.invalid, np.float32(np.nan), values.astype(np.float32))
            absent = np.nan if values.dtype.kind == "f" else _ABSENT if field.name == "flags" else 0
            cube = np.full((*shape, *field.shape), absent, values.dtype)
            cube[round_of, finger_of] = values
            inner = () if not field.parts else ("axis",) if field.parts == AXES else ("electrode",)
            coordinates |= {name: list(field.parts) for name in inner}
            data[field.name] = (("time", "finger", *inner), cube, {"units": field.unit, "long_name": field.what})
        if "electrode" in coordinates:
            places = zip(AXES, ELECTRODE_MM.T, strict=True)
            coordinates |= {f"electrode_{axis}_mm": ("electrode", at, {"units": "mm"}) for axis, at in places}
        dataset = xarray.Dataset(data, coordinates)
        for name in {"flags", "t_us", "time"} & {*dataset.variables}:
            dataset[name].encoding["dtype"] = "float64"  # NetCDF 3 has no wider integer than int32
        if len(t_us):
            dataset["time"].encoding["units"] = f"nanoseconds since {dataset['time'].values[0]}"
        return dataset

    def resample(self, rate_hz: float) -> Selection:
        """The means of each finger's rows over steps of 1 / ``rate_hz``, above 0 and at most the board's 100.

        ``t_us`` is the middle of a step. All means are float64, NaN where no row has a value; ``flags`` are those that
        any of the rows has, ``trust`` is the lowest, other integers those of the first row; labels are all that hold in
        the step, ``gap_s`` the longest. Steps without a row are omitted.
        """
        if not 0 < rate_hz <= FRAME_HZ:
            raise InputError(f"rate_hz is {rate_hz}, expected above 0 and at most {FRAME_HZ}")
        step_us = 1e6 / rate_hz
        step = np.floor(self.rows["t_us"] / step_us).astype(np.int64)
        order = np.lexsort((self.rows["finger"], step))
        rows, step = self.rows[order], step[order]
        first = np.flatnonzero(np.diff(step, prepend=-1) | np.diff(rows["finger"].astype(np.int16), prepend=-1))
        fields = tuple(
            replace(f, dtype="<f8", invalid=None) if f.dtype[1] == "f" or f.invalid is not None else f
            for f in self.fields
        )
        out = np.empty(len(first), dtype_of(fields))
        for before, field in zip(self.fields, fields, strict=True):
            values = rows[field.name]
            if field.name == "flags":
                out["flags"] = np.bitwise_or.reduceat(values, first) if len(first) else values
            elif field.name == "trust":
                out["trust"] = np.minimum.reduceat(values, first) if len(first) else values
            elif field.dtype != "<f8":
                out[field.name] = values[first]
            elif len(first):
                known = ~np.isnan(values) if before.invalid is None else values != before.invalid
                count = np.add.reduceat(known, first, dtype=np.float64)
                total = np.add.reduceat(np.where(known, values, 0.0), first)
                out[field.name] = np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0)
        out["t_us"] = np.round((step[first] + 0.5) * step_us)
        label, gap_s = _joined(self.label[order], first), self.gap_s[order]
        longest_s = np.maximum.reduceat(gap_s, first) if len(first) else gap_s
        return replace(
            self, rows=out, fields=fields, label_of=partial(_given, label), gap_s_of=partial(_given, longest_s)
        )

    def align(self, signal: npt.ArrayLike, t_s: npt.ArrayLike) -> tuple[NDArray[np.float64], Alignment]:
        """Another sensor's ``signal``, (m,) or (m, k) at ``t_s`` (m,) in s of that sensor's clock, at these rows.

        The selection holds one finger, with ``counts``, ``pdc`` or both. Each moves with the load; it is correlated
        with the signal's distance from the median, and the better of the two counts, as in ``biotac calibrate wrench``.
        Ten seconds with a few irregular presses are enough. Returns means over each row's 10 ms, (n,) or (n, k), NaN
        beyond the signal, and the Alignment: ``offset_s`` is the lag, ``sigma_s`` one standard deviation of it. Raises
        RecordingError when the two do not clearly match.
        """
        after_s = {"counts": ELECTRODES_S, "pdc": PDC_S}
        sources = [name for name in after_s if name in (self.rows.dtype.names or ())]
        if not sources or len(np.unique(self.rows["finger"])) != 1:
            raise InputError("align needs the counts or pdc of one finger: select(fingers=..., fields=['counts', ...])")
        other = np.atleast_1d(np.asarray(signal, np.float64))
        times = seconds("the signal", t_s, len(other))
        kept = increasing("the signal", times)
        other, times = other[kept], times[kept]
        step_s = np.diff(times)
        if step_s.max() > max(1.0, 100.0 * np.median(step_s)):
            seen = f"the signal: no sample for {step_s.max():.3g} s after sample {np.argmax(step_s)}"
            warnings.warn(f"{seen}: if its clock jumped there, use one side of it", RecordingWarning, stacklevel=2)
        values, board_s = other.reshape(len(other), -1), self.rows["t_us"] / 1e6
        if times[-1] - times[0] > _LONG * (board_s[-1] - board_s[0]):
            usual_s, span_s = float(np.median(np.diff(times))), float(times[-1] - times[0])
            raise RecordingError(
                f"the signal: times span {span_s:.6g} s, the selection {board_s[-1] - board_s[0]:.6g}; "
                f"{looks_like(1.0 / usual_s, 0.5, 50_000.0)}, or give the part that is of the same run"
            )
        loads = []
        for name in sources:
            own = self.rows[name].reshape(len(self), -1).astype(np.float64)
            own[own == INVALID_COUNT] = np.nan
            loads.append((board_s + after_s[name], _distance(own)))
        found = align_best("the selection and the signal", loads, times, _distance(values))
        at_s = found.to_reference_s(board_s + ELECTRODES_S)  # most of a row, and all results, come from the electrodes
        return means(times, values, at_s).reshape(-1, *other.shape[1:]), found


def _given(values: NDArray[Any], rows: StructArray) -> NDArray[Any]:
    return values  # of those rows


def _joined(label: NDArray[np.str_], first: NDArray[np.intp]) -> NDArray[np.str_]:
    """All labels of the rows from each of ``first`` to the next, each once."""
    texts, code = np.unique(label, return_inverse=True)
    joined = texts[code[first]].tolist() if len(first) else []
    changing = np.flatnonzero(np.diff(code))
    for k in np.unique(np.searchsorted(first, changing, "right") - 1).tolist():
        own = code[first[k] : first[k + 1] if k + 1 < len(first) else None]
        joined[k] = "; ".join(dict.fromkeys(part for c in dict.fromkeys(own.tolist()) for part in texts[c].split("; ")))
        joined[k] = joined[k].strip("; ")
    return np.array(joined, np.str_)


def _distance(values: NDArray[np.float64]) -> NDArray[np.float64]:
    distance: NDArray[np.float64] = np.linalg.norm(values - np.nanmedian(values, axis=0), axis=1)
    return distance
