"""The columns of rows: the one table of names, units and invalid marks for live rows, recordings, views and exports.

``FRAME_DTYPE``, ``Frame``, JSON, the columns of every export and the page host/docs/reference/rows.md are made from it,
or checked against it by tests.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .messages_gen import INVALID_COUNT, INVALID_I16, INVALID_I32
from .sensor_gen import ELECTRODE_NAMES

AXES = ("x", "y", "z")
PAC_SAMPLES = tuple(str(k) for k in range(22))
_ELECTRODES = tuple(ELECTRODE_NAMES)

#: Steps of the wire's integers per unit of a column.
UM_PER_MM = 1_000
MN_PER_N = 1_000
FORCE_LSB_PER_N = 10_000  # force_100un
MNMM_PER_NMM = 1_000
Q4_PER_COUNT = 16

#: The marks for a missing value in the wire's integers, by type.
INVALID_U8, INVALID_U32 = 0xFF, 0xFFFFFFFF
WIRE_INVALID = {"u1": INVALID_U8, "u2": INVALID_COUNT, "u4": INVALID_U32, "i2": INVALID_I16, "i4": INVALID_I32}
_INVALID_BY_CHAR = {np.dtype(kind).char: mark for kind, mark in WIRE_INVALID.items()}  # quicker to look up


@dataclass(frozen=True)
class Field:
    """A column. ``dtype`` is NumPy's; ``parts`` name the components of a vector, which flat formats split into columns.

    ``sent`` is the field of the message that it is made from. ``per_unit`` of that field's steps make one ``unit``;
    None means that the value is sent as it is. ``invalid`` marks a missing value in an integer column; in a float
    column that is NaN.
    """

    name: str
    dtype: str
    unit: str
    what: str
    parts: tuple[str, ...] = ()
    sent: str = ""
    per_unit: int | None = None
    invalid: int | None = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of one row's value."""
        return (len(self.parts),) if self.parts else ()

    def flat_names(self) -> tuple[str, ...]:
        """Names in a flat table: ``force_x_n`` for part x of force_n (the unit stays at the end), ``counts_E1``."""
        stem, _, unit = self.name.rpartition("_")
        named = stem and unit in _UNITS
        return tuple(f"{stem}_{part}_{unit}" if named else f"{self.name}_{part}" for part in self.parts) or (self.name,)


_UNITS = ("n", "nmm", "mm")

_FINGER = Field("finger", "u1", "1", "chip select, 0 to 4")
_TIME = (
    Field("seq", "<u4", "1", "round number, counted by the board, unwrapped"),
    Field("t_us", "<i8", "us", "device time, unwrapped from the first value seen"),
)


def _count(name: str, what: str, parts: tuple[str, ...] = ()) -> Field:
    return Field(name, "<u2", "count", f"{what}, 0 to 4095; 65535 where missing", parts, name, None, INVALID_COUNT)


def _real(name: str, what: str, sent: str, per_unit: int, parts: tuple[str, ...] = (), dtype: str = "<f8") -> Field:
    unit = {"mm": "mm", "n": "N", "nmm": "N*mm"}.get(name.rpartition("_")[2], "count")
    return Field(name, dtype, unit, what, parts, sent, per_unit)


_PRESSURE_FORCE = "magnitude of the force from static pressure, negative below rest; NaN unless calibrated"
_TORSION = "torque about the outward normal at the contact; NaN unless a wrench map gives it"
_AGE = "how much older force, torque and torsion are than the row; 0 unless REPEATED"
_OUT = "bit mask, bit i for electrode i + 1: results do without it"
_SLIP = "rms in which dynamic pressure shakes as skin slips, 0 where it does not; 255 unless EVENTS are subscribed to"
_HALF = "half the width of the 95 % interval about"
_TARE_STATE = Field("tare_state", "u1", "1", "enum tare_state in MESSAGES.md", (), "tare_state")
_TRUST = Field("trust", "u1", "1", "how far the force can be relied on: enum trust in MESSAGES.md", (), "trust")

#: One row per finger and round of slots (10 ms).
FRAME_FIELDS = (
    _FINGER,
    *_TIME,
    _count("counts", "electrodes as read", _ELECTRODES),
    _count("pdc", "static pressure"),
    _count("tac", "thermal flux"),
    _count("tdc", "temperature"),
    _real("tare", "counts at rest, in steps of 1/16; NaN where unknown", "tare_q4", Q4_PER_COUNT, _ELECTRODES, "<f4"),
    _real("pdc_tare", "pressure at rest, in steps of 1/16; NaN where unknown", "pdc_tare_q4", Q4_PER_COUNT),
    _TARE_STATE,
    _real("poc_mm", "point of contact on the core's surface; NaN where invalid", "poc_um", UM_PER_MM, AXES),
    _real("force_n", "force on the finger; NaN where invalid", "force_100un", FORCE_LSB_PER_N, AXES),
    _real("torque_nmm", "torque on the finger about the origin; NaN where invalid", "torque_mnmm", MNMM_PER_NMM, AXES),
    _real("pdc_filtered", "pressure, filtered by the board; NaN where missing", "pdc_filtered_q4", Q4_PER_COUNT),
    _real("pressure_force_n", _PRESSURE_FORCE, "pressure_force_100un", FORCE_LSB_PER_N),
    _real("torsion_nmm", _TORSION, "torsion_mnmm", MNMM_PER_NMM),
    Field("wrench_age_ms", "<u2", "ms", _AGE, (), "wrench_age_ms"),
    Field("electrodes_out", "<u4", "1", _OUT, (), "electrodes_out"),
    _real("normal_n", "how hard the contact presses into the skin; NaN where invalid", "normal_mn", MN_PER_N),
    _real("normal_half_n", f"{_HALF} normal_n; NaN where unknown", "normal_half_mn", MN_PER_N),
    _real("shear_n", "the rest of the force, along the skin; NaN where invalid", "shear_mn", MN_PER_N),
    _real("shear_half_n", f"{_HALF} shear_n; NaN where unknown", "shear_half_mn", MN_PER_N),
    _TRUST,
    Field("slip_level", "u1", "count", _SLIP, (), "slip_level", None, INVALID_U8),
    Field("flags", "<u4", "1", "bits of flags frame in MESSAGES.md; they say why a result is invalid", (), "flags"),
)

#: One row per finger and round: 22 samples, sample k (from 0) is k/2200 s after t_us.
PAC_FIELDS = (_FINGER, *_TIME, _count("pac", "dynamic pressure", PAC_SAMPLES))

#: One row per finger and round: how strongly PAC vibrated, by octave (core/bands.py).
BANDS_FIELDS = (
    _FINGER,
    *_TIME,
    Field("good", "u1", "1", "samples that came as a good word"),
    Field(
        "energy_count2",
        "<f8",
        "count^2",
        "sum of squares of the signal in the band, over 22 samples; NaN without a good word",
        ("18hz", "36hz", "72hz", "147hz", "309hz", "over527hz"),
    ),
)

#: Heartbeats of untouched fingers: a row stands for ``frames`` rounds without a FRAME, the last of which is ``seq``.
IDLE_FIELDS = (
    _FINGER,
    *_TIME,
    Field("frames", "<u2", "1", "rounds that the row stands for", (), "frames"),
    Field("energy_count2", "<u4", "count^2", "sum of squared signals", (), "energy_count2"),
    _count("pdc", "static pressure"),
    _count("tdc", "temperature"),
    _TARE_STATE,
    _TRUST,
    Field("flags", "<u4", "1", "bits of flags frame in MESSAGES.md", (), "flags"),
)


def dtype_of(fields: Sequence[Field]) -> np.dtype[np.void]:
    """The structured dtype of rows with these ``fields``."""
    return np.dtype([(field.name, field.dtype, field.shape) for field in fields])


def values_of(field: Field, sent: Any) -> Any:
    """The column of ``field``, (n,) or (n, parts), from the sent values: in the unit and type of ``field``, NaN if
    invalid.
    """
    if field.per_unit is None:
        return sent.astype(field.dtype, copy=False)
    return to_units(sent, field.per_unit).astype(field.dtype, copy=False)


def to_units(raw: Any, per_unit: int) -> NDArray[np.float64]:
    """Divide integers by ``per_unit``; invalid (the type's minimum, or 0xFFFF unsigned) becomes NaN."""
    out: NDArray[np.float64] = np.true_divide(raw, per_unit, dtype=np.float64)
    np.copyto(out, np.nan, where=raw == _INVALID_BY_CHAR[raw.dtype.char])
    return out


def as_json(row: Any) -> dict[str, Any]:
    """One row, FRAME_DTYPE or an object with the fields as attributes, as JSON types; None where invalid."""
    value_of = row.__getitem__ if isinstance(row, np.void) else lambda name: getattr(row, name)
    return {field.name: _json_value(np.asarray(value_of(field.name)), field) for field in FRAME_FIELDS}


def _json_value(value: Any, field: Field) -> Any:
    missing = np.isnan(value) if field.dtype[1] == "f" else value == field.invalid
    if not field.parts:
        return None if missing else value.item()
    return [None if is_missing else part for part, is_missing in zip(value.tolist(), missing.tolist(), strict=True)]
