"""Frames as users see them: in SI-like units, with the same field names everywhere.

The unit of each column is that of its row in fields.py; C divides (host/binding/units.c).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .fields import BANDS_FIELDS, FRAME_FIELDS, IDLE_FIELDS, INVALID_U8, INVALID_U32, PAC_FIELDS, dtype_of
from .fields import FORCE_LSB_PER_N as FORCE_LSB_PER_N
from .fields import MNMM_PER_NMM as MNMM_PER_NMM
from .fields import Q4_PER_COUNT as Q4_PER_COUNT
from .fields import UM_PER_MM as UM_PER_MM
from .fields import to_units as to_units
from .messages_gen import INVALID_COUNT, TRUST_FLAGS, FrameFlags, TareState, Trust
from .native import ffi, lib
from .sensor_gen import FULL_SCALE_COUNT

StructArray = NDArray[np.void]

#: One row per finger and round of slots; names, units and invalid marks are those of fields.FRAME_FIELDS.
FRAME_DTYPE = dtype_of(FRAME_FIELDS)
_VECTORS = tuple(column.name for column in FRAME_FIELDS if column.parts)


@cache
def _columns(sent: np.dtype[Any]) -> Any:
    """How each column of FRAME_DTYPE comes from those of FRAMEs as they are sent or stored, as bt_unit_column."""
    sent_at: Any = sent.fields
    made_at: Any = FRAME_DTYPE.fields
    columns = []
    for column in FRAME_FIELDS:
        if column.sent:
            (kind, start), (made, to) = sent_at[column.sent][:2], made_at[column.name][:2]
            size = -kind.base.itemsize if kind.base.kind == "i" else kind.base.itemsize
            columns.append((start, to, max(1, len(column.parts)), size, made.base.itemsize, column.per_unit or 0))
    return ffi.new("bt_unit_column[]", columns)


#: 22 samples of dynamic pressure, 1/2200 s apart, the first at ``t_us``; 0xFFFF where missing.
PAC_DTYPE = dtype_of(PAC_FIELDS)

#: How strongly dynamic pressure vibrated in a round, in six octaves, the lowest first; ``t_us`` is that of PAC.
BANDS_DTYPE = dtype_of(BANDS_FIELDS)

#: Heartbeats of untouched fingers (``rest=False``): a row stands for ``frames`` rounds for which no FRAME was sent;
#: ``seq`` is that of the last one. ``energy_count2`` is the sum of the squared signals, in count^2.
IDLE_DTYPE = dtype_of(IDLE_FIELDS)


def joined(parts: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """All rows of arrays of one dtype; NumPy's concatenate would compare every field of theirs."""
    return np.frombuffer(bytearray().join(map(np.ascontiguousarray, parts)), parts[0].dtype)  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One round of slots (10 ms) of one finger. Two are equal when all values are equal, where NaN equals NaN.

    Shapes: counts (19,) uint16; tare (19,) float32; poc_mm, force_n, torque_nmm (3,) float64; the others
    are numbers. Names, units and invalid marks are as in FRAME_DTYPE. Force and torque act on the finger; x points to
    the tip, y to E11's side, z is dorsal.
    """

    finger: int
    seq: int
    t_us: int
    counts: NDArray[np.uint16]
    pdc: int
    tac: int
    tdc: int
    poc_mm: NDArray[np.float64]
    force_n: NDArray[np.float64]
    torque_nmm: NDArray[np.float64]
    flags: FrameFlags
    tare: NDArray[np.float32] = field(default_factory=lambda: np.full(19, np.nan, np.float32))
    pdc_tare: float = math.nan
    tare_state: int = TareState.INIT
    pdc_filtered: float = math.nan
    pressure_force_n: float = math.nan
    torsion_nmm: float = math.nan
    wrench_age_ms: int = 0
    electrodes_out: int = 0
    normal_n: float = math.nan
    normal_half_n: float = math.nan
    shear_n: float = math.nan
    shear_half_n: float = math.nan
    trust: Trust = Trust.NONE
    slip_level: int = INVALID_U8

    @property
    def reasons(self) -> FrameFlags:
        """The flags that hold ``trust`` down; without one, the interval is too wide, or there is no number."""
        return self.flags & TRUST_FLAGS.get(self.trust, FrameFlags(0))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Frame):
            return NotImplemented
        pairs = [(getattr(self, value.name), getattr(other, value.name)) for value in fields(self)]
        return all(np.array_equal(own, others, equal_nan=np.asarray(own).dtype.kind == "f") for own, others in pairs)

    def __hash__(self) -> int:
        return hash((self.finger, self.seq, self.t_us))

    @classmethod
    def from_row(cls, row: Any) -> Frame:
        """Make a Frame from one row of a FRAME_DTYPE array."""
        # All columns at once: a row is made into a Frame thousands of times a second.
        values = dict(zip(FRAME_DTYPE.names or (), row.item(), strict=True))
        for name in _VECTORS:
            values[name] = values[name].copy()
        values["flags"], values["trust"] = FrameFlags(values["flags"]), trust_of(values["trust"])
        return cls(**values)


def trust_of(level: int) -> Trust:
    """A level of trust as sent. Nobody is to act on one that is not known here, of a newer board: it reads as HOLD."""
    return Trust(level) if level <= Trust.ACT else Trust.HOLD


def frames_from_wire(messages: StructArray, seq: NDArray[Any], t_us: NDArray[Any]) -> StructArray:
    """Convert FRAME messages (n,) with unwrapped seq and t_us to FRAME_DTYPE (n,)."""
    sent, columns = np.ascontiguousarray(messages), _columns(messages.dtype)
    out = np.empty(len(sent), FRAME_DTYPE)
    rows, made = ffi.from_buffer("uint8_t[]", sent), ffi.from_buffer("uint8_t[]", out, require_writable=True)
    lib.bt_units(rows, len(sent), sent.itemsize, columns, len(columns), made, out.itemsize)
    out["finger"], out["seq"], out["t_us"] = messages["finger"], seq, t_us
    return out


def invalid_frames(n: int) -> StructArray:
    """FRAME_DTYPE (n,) of which every value is invalid, and 0 where a column has no mark for that."""
    rows = np.zeros(n, FRAME_DTYPE)
    for column in FRAME_FIELDS:
        rows[column.name] = np.nan if column.dtype[1] == "f" else column.invalid or 0
    return rows


def tare_to_q4(tare_counts: ArrayLike) -> NDArray[np.uint16]:
    """A tare in counts, of any shape, in the board's unit of 1/16 count; halves are rounded up.

    Raises ValueError unless all of it is 0..4095 counts.
    """
    tare = np.asarray(tare_counts, dtype=np.float64)
    bad = ~((tare >= 0) & (tare <= FULL_SCALE_COUNT))
    if bad.any():
        raise ValueError(f"the tare holds {tare[bad].flat[0]:g}, expected 0..{FULL_SCALE_COUNT} counts")
    return np.floor(tare * Q4_PER_COUNT + 0.5).astype(np.uint16)


def age_ms(age_s: float | None) -> int:
    """The age of a tare in TARE_SET, from seconds; None: unknown. Raises ValueError for a negative one or NaN."""
    if age_s is not None and not age_s >= 0:
        raise ValueError(f"age_s is {age_s}, expected 0 or more, or None where it is unknown")
    return INVALID_U32 if age_s is None else round(min(1000 * age_s, INVALID_U32 - 1))


def electrode_signals(messages: StructArray) -> NDArray[np.float64]:
    """e = count - tare of FRAME messages, in counts, shape (n, 19); NaN where either is missing."""
    counts, tare_q4 = messages["counts"], messages["tare_q4"]
    missing = (counts == INVALID_COUNT) | (tare_q4 == INVALID_COUNT)
    return np.where(missing, np.nan, counts - tare_q4 / Q4_PER_COUNT)
