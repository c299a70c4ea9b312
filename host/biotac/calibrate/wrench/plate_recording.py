"""A recording with its own truth, checked when it is loaded.

A calibration from a bad recording looks like any other. Every refusal here is for a mistake that is easy to make in the
laboratory and hard to see in the coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ...errors import RecordingError
from ...kernels.geometry import Floats
from ...map.columns import AXES
from ...recording.npz_file import counts_field, read_npz, to_lin_frame
from ...wire import sensor_gen as _sensor
from ...wire.native import lib
from . import contact
from .splits import BLOCKS, GUARD_ROWS, contacts

MIN_ROWS = BLOCKS * 2 * GUARD_ROWS  # a shorter block would be nothing but its two guards
REST_N = 0.1  # a plate's reading below this means that nothing touches
# Of the centred forces. Presses straight down have only a plate's noise and the hand's tremor in the other two axes.
MAX_CONDITION, NOTED_CONDITION = 1000.0, 30.0
MIN_REST_ROWS = 50
MAX_REST_SWING_COUNTS = 100.0  # 10 % to 90 %: warming up is 8 counts in 10 s, a press hundreds
RAIL_LOW, RAIL_HIGH = 0, lib.BT_THRESHOLD_RAIL_COUNT  # beyond these an electrode is railed
MAX_RAILED_SHARE = 0.01
LEAST_SWING_COUNTS = 2  # over so many rows, the noise alone of a live electrode exceeds this
MAX_CLIPPED_SHARE = 0.005
# |F| per RMS count: a flat plate affects all electrodes and gives 0.005 to 0.01, a point 0.06 (medians over rows).
# Grams (x 102) and millinewtons (x 1000) are at least 0.49: the limit is the geometric mean of that and 0.06.
NEWTON_PER_COUNT = (0.002, 0.17)
MIN_DRIFT_SHARE = 0.5  # of the idle recording's variance: less is noise, which has no direction
# RMS difference of the electrodes between two rests, about the mean, which is drift. Two rests of one finger differ by
# how unevenly its electrodes drift (10 % of some hundred counts), rests of two fingers by the electrodes themselves (86
# to 170 counts).
MAX_OTHER_REST_COUNTS = 60.0

FIELDS = ("E", "F", "M", "PDC", "E_base", "E_idle", "torsion", "contact", "serial")


@dataclass(frozen=True)
class Run:
    """Counts with the force that made them; frame, signs and origin are Lin's (force on the finger).

    ``counts`` is (n, 19) and ``tare`` (19,), both in counts. ``truth`` is (n, 3) in N, (n, 6) with N mm about the
    origin, or (n, 7) with N mm about the outward normal at the contact, too. ``pdc`` (n,) is in counts above rest, or
    None. ``drift`` (19,) is each electrode's drift for one count of mean drift. ``rest`` (n,) is true for rows without
    contact. ``notes`` say what was assumed. ``serial`` is the sensor's serial number, "" where unknown. ``by_clocks``
    is true if force and counts were aligned by their own times. ``air`` (m, 19) are the counts of E_base, or None.
    ``contact`` (n,) is the contact that each row belongs to, or None for rows in order of time.
    """

    name: str
    counts: Floats
    tare: Floats
    truth: Floats
    pdc: Floats | None
    drift: Floats
    rest: npt.NDArray[np.bool_]
    notes: tuple[str, ...]
    serial: str = ""
    by_clocks: bool = False
    air: Floats | None = None
    contact: npt.NDArray[np.int64] | None = None

    @property
    def axes(self) -> tuple[str, ...]:
        return AXES[: self.truth.shape[1]]


def load_run(path: Path) -> Run:
    """A run from an .npz file of one finger, with rows at a steady rate.

    Required fields are ``E`` (n, 19), raw counts, and ``F`` (n, 3) in N. Optional fields are ``M`` (n, 3) in N mm about
    Lin's origin, with F and M in the recorded axes (X lateral, Y to the tip, Z out of the pad); ``PDC`` (n,) in counts;
    ``E_base`` (m, 19), the finger in free air, needed where the run itself never rests; ``E_idle`` (k, 19), an
    untouched finger with the drift as first principal component; ``torsion`` (n,) in N mm about the outward normal at
    the contact, used only with M and otherwise computed; ``contact`` (n,), integers that say which contact a row
    belongs to, where rows are not in order of time; and ``serial``, the sensor's serial number as text. Raises
    RecordingError with the values seen, in numbers.
    """
    return run_of(path, read_npz(path, FIELDS))


def run_of(path: Path, fields: dict[str, npt.NDArray[Any]]) -> Run:
    """A run from a file's fields, as load_run(); ``path`` is for error messages."""
    missing = [name for name in ("E", "F") if name not in fields]
    if missing:
        seen = ", ".join(fields) or "none of the known fields"
        raise RecordingError(
            f"{path}: holds {seen}: expected E (n, 19) in counts and F (n, 3) in N; save {' and '.join(missing)} too"
        )
    counts = _counts(path, "E", fields)
    rows = len(counts)
    check_rows(path, rows)
    force = to_lin_frame(numbers(path, "F", fields["F"], (rows, 3), "N"))
    check_clipping(path, "F", force)
    truth = force
    about_torsion: tuple[str, ...] = ()
    if "M" in fields:
        moment = to_lin_frame(numbers(path, "M", fields["M"], (rows, 3), "N mm"))
        about_normal, about_torsion = contact.torsion_truth(path, fields.get("torsion"), force, moment)
        truth = np.column_stack([force, moment, about_normal])
    check_electrodes(path, counts)
    rest: npt.NDArray[np.bool_] = np.linalg.norm(force, axis=1) < REST_N
    base = _counts(path, "E_base", fields) if "E_base" in fields else None
    tare, note_of_tare = _tare(path, base, counts, force, rest)
    check_units(path, counts - tare, force)
    about_loads = check_loads(path, force)
    # only after the check of units: in others a press may look like a rest
    if base is not None and rest.sum() >= MIN_REST_ROWS:
        _check_same_finger(path, tare, np.median(counts[rest], axis=0))
    pdc = None
    if "PDC" in fields:
        raw = counts_field(path, "PDC", fields["PDC"], rows, None).astype(np.float64)
        # without a rest in the run, the lowest percent stands in for it; an offset does not harm a linear model
        pdc = raw - (np.median(raw[rest]) if rest.sum() >= MIN_REST_ROWS else np.percentile(raw, 1))
    drift, note = np.ones(len(_sensor.ELECTRODE_NAMES)), "drift: no E_idle, all electrodes assumed to drift alike"
    if "E_idle" in fields:
        drift, note = drift_of("E_idle", _counts(path, "E_idle", fields))
    serial = fields.get("serial", np.array(""))
    if serial.dtype.kind != "U" or serial.size != 1:
        raise RecordingError(f"{path}: field serial is {serial.dtype}: expected one string; save it as str")
    return Run(
        path.name,
        counts,
        tare,
        truth,
        pdc,
        drift,
        rest,
        (note_of_tare, note, *about_torsion, *about_loads),
        serial=str(serial.reshape(())),
        air=base,
        contact=contacts(path, fields["contact"], rows) if "contact" in fields else None,
    )


def _counts(path: Path, name: str, fields: dict[str, npt.NDArray[Any]]) -> Floats:
    return counts_field(path, name, fields[name], None, len(_sensor.ELECTRODE_NAMES)).astype(np.float64)


def numbers(path: Path, name: str, array: npt.NDArray[Any], shape: tuple[int, ...], unit: str) -> Floats:
    """Field ``name`` as float64. Raises RecordingError unless it has ``shape`` and is finite."""
    if array.shape != shape or array.dtype.kind not in "iuf":
        raise RecordingError(
            f"{path}: field {name} is {array.dtype} {array.shape}: expected {shape} in {unit}, one row per frame"
        )
    bad = ~np.isfinite(array.reshape(len(array), -1)).all(axis=1)
    if bad.any():
        raise RecordingError(
            f"{path}: field {name} is not finite in {bad.sum()} of {len(bad)} rows, first in row {np.argmax(bad)}: "
            f"expected {unit} in every row; drop those rows from all fields"
        )
    return array.astype(np.float64)


def check_rows(where: object, rows: int) -> None:
    """Refuse a run that is too short to be held out block by block. Raises RecordingError."""
    if rows < MIN_ROWS:
        raise RecordingError(
            f"{where}: {rows} rows: expected at least {MIN_ROWS}, for {BLOCKS} blocks of twice the guard of "
            f"{GUARD_ROWS} rows; record longer"
        )


def check_clipping(path: object, name: str, force: Floats) -> None:
    """Refuse forces at the end of a plate's range: only there are extremes exactly repeated. Raises RecordingError."""
    for axis in range(3):
        column = force[:, axis]
        for end in (column.min(), column.max()):
            share = float((column == end).mean())
            if abs(end) > REST_N and share > MAX_CLIPPED_SHARE:
                raise RecordingError(
                    f"{path}: {share:.1%} of the rows of {name} read exactly {end:.4g} N along {'xyz'[axis]}, the "
                    f"extreme: expected at most {MAX_CLIPPED_SHARE:.1%}; the force sensor is saturated, press less"
                )


def check_electrodes(path: object, counts: Floats) -> None:
    share = ((counts <= RAIL_LOW) | (counts >= RAIL_HIGH)).mean(axis=0)
    worst = int(np.argmax(share))
    if share[worst] > MAX_RAILED_SHARE:
        raise RecordingError(
            f"{path}: {_sensor.ELECTRODE_NAMES[worst]} is saturated (count {RAIL_LOW}, or {RAIL_HIGH} and above) in "
            f"{share[worst]:.1%} of the rows: expected at most {MAX_RAILED_SHARE:.0%}; press less, or check it"
        )
    swing = np.ptp(counts, axis=0)
    least = int(np.argmin(swing))
    if swing[least] <= LEAST_SWING_COUNTS:
        raise RecordingError(
            f"{path}: {_sensor.ELECTRODE_NAMES[least]} varies by {swing[least]:.0f} count(s) in {len(counts)} rows: "
            f"expected more than {LEAST_SWING_COUNTS}; it is stuck; check its wiring and record again"
        )


def _tare(
    path: Path, base: Floats | None, counts: Floats, force: Floats, rest: npt.NDArray[np.bool_]
) -> tuple[Floats, str]:
    """Counts at rest, from E_base or from the run's own rows without force, and a note."""
    if base is not None:
        low, median, high = np.percentile(base, (10, 50, 90), axis=0)
        worst = int(np.argmax(high - low))
        if high[worst] - low[worst] > MAX_REST_SWING_COUNTS:
            raise RecordingError(
                f"{path}: E_base is not at rest: {_sensor.ELECTRODE_NAMES[worst]} varies by "
                f"{high[worst] - low[worst]:.0f} counts: expected at most {MAX_REST_SWING_COUNTS:.0f}; record it in air"
            )
        # the median, because a brief touch in the recording must not change it
        return median, f"tare: median of {len(base)} rows of E_base"
    if rest.sum() < MIN_REST_ROWS:
        raise RecordingError(
            f"{path}: never at rest: {rest.sum()} rows below {REST_N} N, the lowest force is "
            f"{np.linalg.norm(force, axis=1).min():.2f} N, and there is no E_base: expected {MIN_REST_ROWS} rows "
            f"without contact; let go in between, or add E_base"
        )
    resting: Floats = np.median(counts[rest], axis=0)
    return resting, f"tare: median of {rest.sum()} rows below {REST_N} N"


def check_units(path: object, signal: Floats, force: Floats) -> None:
    size = np.linalg.norm(force, axis=1)
    touched = size >= 0.25 * np.percentile(size, 90)
    if not touched.any() or size.max() == 0.0:
        raise RecordingError(f"{path}: F is 0 in every row: expected forces in N; was the plate connected?")
    per_count = float(np.median(size[touched]) / max(np.sqrt((signal[touched] ** 2).mean(axis=1)).mean(), 1e-9))
    low, high = NEWTON_PER_COUNT
    if not low <= per_count <= high:
        guess = "is F in gf or mN, or are counts missing?" if per_count > high else "is F in kN or kgf?"
        raise RecordingError(
            f"{path}: {per_count:.3g} units of F per RMS count (median |F| {np.median(size[touched]):.4g}): expected "
            f"{low:g} to {high:g}, as in newtons on a BioTac; {guess}"
        )


def check_loads(where: object, force_n: Floats) -> tuple[str, ...]:
    """A note where forces (n, 3), in N, hardly vary in some direction.

    The condition number is that of the centred forces: their standard deviation along the direction in which they vary
    most over that in which they vary least. Raises RecordingError where they determine no map: on a line or in a plane.
    """
    _, size, way = np.linalg.svd(force_n - force_n.mean(axis=0), full_matrices=False)
    condition = float(size[0] / max(size[2], 1e-300))
    least = "/".join(f"{part:.2f}" for part in way[2])
    text = f"condition number of the forces {condition:.3g}, they vary least along {least} (x/y/z)"
    if condition > MAX_CONDITION:
        lie = "on one line" if size[0] > MAX_CONDITION * size[1] else "in one plane"
        raise RecordingError(
            f"{where}: the forces lie {lie}: {text}: expected at most {MAX_CONDITION:g}; shear the finger to the tip, "
            "to the base and to both sides, too"
        )
    return (f"{text}: what the map says of it rests on little",) if condition > NOTED_CONDITION else ()


def _check_same_finger(path: Path, base: Floats, resting: Floats) -> None:
    """Refuse an E_base of another finger: one finger's rests differ by drift, about the same on all electrodes."""
    apart = resting - base
    spread = float(apart.std())
    if spread > MAX_OTHER_REST_COUNTS:
        worst = int(np.argmax(np.abs(apart - apart.mean())))
        raise RecordingError(
            f"{path}: E at rest and E_base do not match: apart from a common {apart.mean():+.0f} counts they "
            f"differ by {spread:.0f} RMS ({_sensor.ELECTRODE_NAMES[worst]} by {apart[worst]:+.0f}): expected at most "
            f"{MAX_OTHER_REST_COUNTS:.0f}; is E_base from another finger?"
        )


def drift_of(name: str, idle: Floats) -> tuple[Floats, str]:
    """The electrodes' drift (19,) for one count of mean drift, from an untouched finger's counts, and a note."""
    common: Floats = np.ones(len(_sensor.ELECTRODE_NAMES))
    variance, direction = (
        np.linalg.eigh(np.cov(idle, rowvar=False)) if len(idle) > 1 else (np.zeros(1), common[:, None])
    )
    share = float(variance[-1] / max(variance.sum(), 1e-12))
    first: Floats = direction[:, -1] * np.sign(direction[:, -1].sum())
    mean = float(first.mean())
    # loadings of both signs mean a touch or a broken electrode, and dividing by their mean would inflate them
    if share < MIN_DRIFT_SHARE or mean < 0.5 * float(np.abs(first).mean()):
        note = f"drift: {name} ({share:.0%} in its first component) shows no common drift; electrodes assumed alike"
        return common, note
    return first / mean, f"drift: first component of {name}, {share:.1%} of its variance"
