"""What a user sees of a frame: SI-like units, the same field names everywhere.

Wire integers become mm, N and N*mm here and nowhere else.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .messages_gen import INVALID_COUNT, INVALID_I16, INVALID_I32, FrameFlags

UM_PER_MM = 1_000
FORCE_LSB_PER_N = 10_000  # force_100un
MNMM_PER_NMM = 1_000
Q4_PER_COUNT = 16

#: One row per finger and round of slots. ``counts``, ``pdc``, ``tac`` and ``tdc`` are raw counts
#: 0..4095, 0xFFFF where no good word came. ``poc_mm``, ``force_n`` and ``torque_nmm`` are NaN where
#: invalid; ``flags`` (FrameFlags) says why. ``t_us`` is device time, unwrapped from the first value seen
#: (a board that was up for over 71.6 minutes by then began earlier). ``poc_sigma_mm`` and
#: ``force_sigma_n`` are one standard deviation, from the noise measured at rest; NaN unless subscribed to.
#: ``pdc_filtered`` is pressure in counts through the board's filter, NaN without a good word; ``pressure_force_n``
#: the magnitude of the force it tells of, negative below rest, NaN for a finger without a pressure calibration.
#: ``torsion_nmm`` is torque about the outward normal at the contact, NaN for a finger without a wrench map that has it.
FRAME_DTYPE = np.dtype(
    [
        ("finger", "u1"),
        ("seq", "<u4"),
        ("t_us", "<i8"),
        ("counts", "<u2", (19,)),
        ("pdc", "<u2"),
        ("tac", "<u2"),
        ("tdc", "<u2"),
        ("poc_mm", "<f8", (3,)),
        ("force_n", "<f8", (3,)),
        ("torque_nmm", "<f8", (3,)),
        ("poc_sigma_mm", "<f8"),
        ("force_sigma_n", "<f8", (3,)),
        ("pdc_filtered", "<f8"),
        ("pressure_force_n", "<f8"),
        ("torsion_nmm", "<f8"),
        ("flags", "<u4"),
    ]
)

#: Twenty-two dynamic pressure samples, 1/2200 s apart from ``t_us`` on; 0xFFFF where missing.
PAC_DTYPE = np.dtype([("finger", "u1"), ("seq", "<u4"), ("t_us", "<i8"), ("pac", "<u2", (22,))])

#: Heartbeats of untouched fingers (Hand.subscribe): a row stands for ``frames`` rounds of which no FRAME
#: was sent; ``seq`` is the last of them. ``energy_count2`` is the sum of squared signals.
IDLE_DTYPE = np.dtype(
    [
        ("finger", "u1"),
        ("seq", "<u4"),
        ("t_us", "<i8"),
        ("frames", "<u2"),
        ("energy_count2", "<u4"),
        ("pdc", "<u2"),
        ("tdc", "<u2"),
        ("flags", "<u4"),
    ]
)

StructArray = NDArray[np.void]


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """One finger, one round of slots (10 ms). Equal to another when all values are, NaN to NaN.

    Shapes: counts (19,) uint16; poc_mm, force_n, torque_nmm (3,) float64; the rest are numbers. Units and
    invalid marks as in FRAME_DTYPE. Force and torque act on the finger; x to the tip, y to E11's side, z dorsal.
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
    pressure_force_n: float = math.nan
    torsion_nmm: float = math.nan

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Frame):
            return NotImplemented
        pairs = [(getattr(self, field.name), getattr(other, field.name)) for field in fields(self)]
        return all(np.array_equal(mine, its, equal_nan=np.asarray(mine).dtype.kind == "f") for mine, its in pairs)

    def __hash__(self) -> int:
        return hash((self.finger, self.seq, self.t_us))

    @classmethod
    def from_row(cls, row: Any) -> Frame:
        """Build from one row of a FRAME_DTYPE array."""
        return cls(
            finger=int(row["finger"]),
            seq=int(row["seq"]),
            t_us=int(row["t_us"]),
            counts=row["counts"].copy(),
            pdc=int(row["pdc"]),
            tac=int(row["tac"]),
            tdc=int(row["tdc"]),
            poc_mm=row["poc_mm"].copy(),
            force_n=row["force_n"].copy(),
            torque_nmm=row["torque_nmm"].copy(),
            flags=FrameFlags(int(row["flags"])),
            pressure_force_n=float(row["pressure_force_n"]),
            torsion_nmm=float(row["torsion_nmm"]),
        )


def to_units(raw: NDArray[Any], per_unit: int) -> NDArray[np.float64]:
    """Divide integers by ``per_unit``; invalid (the type's minimum, or 0xFFFF unsigned) becomes NaN."""
    invalid = {"u2": INVALID_COUNT, "i2": INVALID_I16, "i4": INVALID_I32}[raw.dtype.str[1:]]
    out = raw / float(per_unit)
    out[raw == invalid] = np.nan
    return np.asarray(out, dtype=np.float64)


def frames_from_wire(messages: StructArray, seq: NDArray[Any], t_us: NDArray[Any]) -> StructArray:
    """Convert FRAME messages (n,) with unwrapped seq and t_us to FRAME_DTYPE (n,)."""
    out = np.empty(len(messages), FRAME_DTYPE)
    out["seq"] = seq
    out["t_us"] = t_us
    for name in ("finger", "counts", "pdc", "tac", "tdc", "flags"):
        out[name] = messages[name]
    out["poc_mm"] = to_units(messages["poc_um"], UM_PER_MM)
    out["force_n"] = to_units(messages["force_100un"], FORCE_LSB_PER_N)
    out["torque_nmm"] = to_units(messages["torque_mnmm"], MNMM_PER_NMM)
    out["poc_sigma_mm"] = to_units(messages["poc_sigma_um"], UM_PER_MM)
    out["force_sigma_n"] = to_units(messages["force_sigma_100un"], FORCE_LSB_PER_N)
    out["pdc_filtered"] = to_units(messages["pdc_filtered_q4"], Q4_PER_COUNT)
    out["pressure_force_n"] = to_units(messages["pressure_force_100un"], FORCE_LSB_PER_N)
    out["torsion_nmm"] = to_units(messages["torsion_mnmm"], MNMM_PER_NMM)
    return out


def tare_to_q4(tare_counts: NDArray[np.float64]) -> NDArray[np.uint16]:
    """A tare in counts 0..4095 to the board's 1/16 count, halves up; any shape."""
    return np.floor(tare_counts * 16 + 0.5).astype(np.uint16)


def electrode_signals(messages: StructArray) -> NDArray[np.float64]:
    """e = count - tare of FRAME messages, in counts, shape (n, 19); NaN where either is missing."""
    counts, tare_q4 = messages["counts"], messages["tare_q4"]
    missing = (counts == INVALID_COUNT) | (tare_q4 == INVALID_COUNT)
    return np.where(missing, np.nan, counts - tare_q4 / 16.0)
