"""What every export holds: columns in SI units, made once from a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..recording.layout import frame_id
from ..recording.reader import Recording
from ..wire import messages_gen as wire
from ..wire import sensor_gen as sensor
from ..wire.frames import StructArray, to_units

#: Told a share 0..1 of the work that is done.
Show = Callable[[float], None]

AXES = ("x", "y", "z")
PAC_SAMPLES = tuple(str(k) for k in range(22))


@dataclass(frozen=True)
class Column:
    """``parts`` name the components of a vector column; a flat format has one column ``name_part`` each."""

    name: str
    unit: str
    what: str
    parts: tuple[str, ...] = ()


_TIME = (
    Column("seq", "1", "number of the round, counted by the board"),
    Column("t_us", "us", "device time, unwrapped"),
    Column("stamp_ns", "ns", "device time on the host's clock (Unix): the recording's start plus elapsed device time"),
)
#: One row a finger and round of 10 ms.
COLUMNS = (
    *_TIME,
    Column("force_n", "N", "force on the finger; NaN where invalid", AXES),
    Column("torque_nm", "N*m", "torque on the finger about the origin, x derived; NaN where invalid", AXES),
    Column("poc_m", "m", "point of contact on the core's surface; NaN where invalid", AXES),
    Column("force_sigma_n", "N", "one standard deviation; NaN unless subscribed to", AXES),
    Column("poc_sigma_m", "m", "one standard deviation; NaN unless subscribed to"),
    Column("pressure_force_n", "N", "magnitude of the force from static pressure; NaN unless calibrated"),
    Column("torsion_nm", "N*m", "torque about the outward normal at the contact; NaN unless a wrench map has it"),
    Column("flags", "1", "bits of flags frame in MESSAGES.md; say why a result is NaN"),
    Column("tare_state", "1", "enum tare_state in MESSAGES.md"),
    Column("counts", "count", "electrodes as read, 0..4095; 65535 where missing", tuple(sensor.ELECTRODE_NAMES)),
    Column("tare", "count", "subtracted from counts; NaN where unknown", tuple(sensor.ELECTRODE_NAMES)),
    Column("pdc", "count", "static pressure, 0..4095; 65535 where missing"),
    Column("tac", "count", "thermal flux, 0..4095; 65535 where missing"),
    Column("tdc", "count", "temperature, 0..4095; 65535 where missing"),
    Column("pdc_tare", "count", "pressure at rest; NaN where unknown"),
    Column("pdc_filtered", "count", "pressure through the board's filter; NaN where missing"),
)
#: One row a finger and round: 22 samples, the k-th k/2200 s after t_us.
PAC_COLUMNS = (*_TIME, Column("pac", "count", "dynamic pressure, 0..4095; 65535 where missing", PAC_SAMPLES))


@dataclass(frozen=True)
class Table:
    """One finger's rows of one kind (``frames`` or ``pac``); arrays (n,) or (n, parts) by column name."""

    kind: str
    finger: int
    columns: tuple[Column, ...]
    arrays: dict[str, NDArray[Any]]

    @property
    def frame_id(self) -> str:
        """The coordinate frame of its vectors."""
        return frame_id(self.finger)

    def __len__(self) -> int:
        return len(self.arrays["seq"])

    def flat(self) -> Iterator[tuple[str, Column, NDArray[Any]]]:
        """Scalar columns (n,), vectors taken apart: ``force_x_n`` of force_n, ``counts_E1`` of counts."""
        for column in self.columns:
            values = self.arrays[column.name]
            if not column.parts:
                yield column.name, column, values
            for k, part in enumerate(column.parts):
                yield flat_name(column, part), column, values[:, k]


def flat_name(column: Column, part: str) -> str:
    """``force_n``, x -> ``force_x_n``: the unit stays at the end."""
    stem, _, unit = column.name.rpartition("_")
    return f"{stem}_{part}_{unit}" if stem and unit in ("n", "nm", "m") else f"{column.name}_{part}"


def tables(recording: Recording) -> list[Table]:
    """Frames and PAC of every finger that has any, in the fingers' order."""
    made = []
    for finger in recording.fingers:
        for kind, columns, rows in (
            ("frames", COLUMNS, _frames(recording, finger)),
            ("pac", PAC_COLUMNS, _pac(recording, finger)),
        ):
            if len(rows["seq"]):
                made.append(Table(kind, finger, columns, rows))
    return made


def _frames(recording: Recording, finger: int) -> dict[str, NDArray[Any]]:
    mine = recording.frames["finger"] == finger
    frames, sent = recording.frames[mine], recording.wire[mine]
    return _times(recording, frames) | {
        "force_n": frames["force_n"],
        "torque_nm": to_units(sent["torque_mnmm"], 1_000_000),
        "poc_m": to_units(sent["poc_um"], 1_000_000),
        "force_sigma_n": frames["force_sigma_n"],
        "poc_sigma_m": to_units(sent["poc_sigma_um"], 1_000_000),
        "pressure_force_n": frames["pressure_force_n"],
        "torsion_nm": to_units(sent["torsion_mnmm"], 1_000_000),
        "flags": frames["flags"],
        "tare_state": sent["tare_state"],
        "counts": frames["counts"],
        "tare": _q4(sent["tare_q4"]),
        "pdc": frames["pdc"],
        "tac": frames["tac"],
        "tdc": frames["tdc"],
        "pdc_tare": _q4(sent["pdc_tare_q4"]),
        "pdc_filtered": frames["pdc_filtered"],
    }


def _pac(recording: Recording, finger: int) -> dict[str, NDArray[Any]]:
    rows = recording.pac[recording.pac["finger"] == finger]
    return _times(recording, rows) | {"pac": rows["pac"]}


def _times(recording: Recording, rows: StructArray) -> dict[str, NDArray[Any]]:
    elapsed_us = rows["t_us"] - recording.begin_us
    return {"seq": rows["seq"], "t_us": rows["t_us"], "stamp_ns": recording.begin_ns + elapsed_us * 1000}


def _q4(values: NDArray[Any]) -> NDArray[np.float64]:
    return np.where(values == wire.INVALID_COUNT, np.nan, values / 16.0)
