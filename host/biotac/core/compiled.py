"""The compiled firmware core and its float64 reference, over whole arrays.

Both run over the same recorded integers, so that any difference comes from arithmetic alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..wire import messages_gen as wire
from ..wire.native import ffi, lib
from ..wire.sensor_gen import ELECTRODE_NAMES, FULL_SCALE_COUNT

NN_PER_N = 1e9
ELECTRODES = len(ELECTRODE_NAMES)
Settings = dict[wire.Setting, int]


@dataclass(frozen=True)
class Results:
    """poc_mm, force_n, torque_nmm, each (n, 3) float64; NaN where there is no answer."""

    poc_mm: NDArray[np.float64]
    force_n: NDArray[np.float64]
    torque_nmm: NDArray[np.float64]


def default_settings() -> Settings:
    """The settings that a board starts with."""
    return {setting: spec.default for setting, spec in wire.SETTINGS.items()}


def on_board_q4(
    counts: NDArray[np.uint16], tare_q4: NDArray[np.uint16], settings: Settings
) -> tuple[NDArray[np.int16], NDArray[np.int32], NDArray[np.int32], NDArray[np.uint32]]:
    """Run the on-board integer kernels on the integers of FRAME messages, both (n, 19).

    Returns poc_um, force_100un, torque_mnmm, each (n, 3), and the kernel's flags (n,).
    Raises ValueError for other shapes or ranges.
    """
    raw = integers("counts", counts, np.uint16, None, ELECTRODES)
    tare_q4 = integers("tare_q4", tare_q4, np.uint16, len(raw), ELECTRODES)
    board = board_settings(settings)
    kernel = ffi.new("bt_solve_settings *", lib.bt_solve_settings_from(board))
    n = len(raw)
    poc_um, flags = np.empty((n, 3), np.int16), np.empty(n, np.uint32)
    force_100un, torque_mnmm = np.empty((n, 3), np.int32), np.empty((n, 3), np.int32)
    lib.bt_kernel_frames(n, *pointers(raw, tare_q4), kernel, *pointers(poc_um, force_100un, torque_mnmm, flags))
    return poc_um, force_100un, torque_mnmm, flags


def pressure_force_100un(
    filtered_q4: NDArray[np.uint16], tare_q4: NDArray[np.uint16], gain_nn: int
) -> NDArray[np.int32]:
    """The board's force from pressure, from the integers of FRAME messages, all (n,); see core/solve/pressure.h.

    Raises ValueError for other shapes or ranges.
    """
    filtered_q4 = integers("filtered_q4", filtered_q4, np.uint16, None)
    tare_q4 = integers("tare_q4", tare_q4, np.uint16, len(filtered_q4))
    board_settings({wire.Setting.PRESSURE_GAIN_NN: gain_nn})  # raises ValueError out of range
    out = np.empty(len(filtered_q4), np.int32)
    lib.bt_pressure_forces(len(out), *pointers(filtered_q4, tare_q4), gain_nn, *pointers(out))
    return out


def pressure_filtered_q4(pdc: NDArray[np.uint16], filter_milli: int) -> NDArray[np.uint16]:
    """The board's filter over the PDC words (n,) of consecutive rounds, from its initial state; in 1/16 count.

    Raises ValueError for other shapes or ranges.
    """
    pdc = integers("pdc", pdc, np.uint16, None)
    board_settings({wire.Setting.PRESSURE_FILTER_MILLI: filter_milli})  # raises ValueError out of range
    out = np.empty(len(pdc), np.uint16)
    lib.bt_pressure_filter(len(out), *pointers(pdc), filter_milli, *pointers(out))
    return out


def board_settings(settings: Settings) -> Any:
    """The C struct bt_settings with these values; settings left out have their defaults.

    Raises ValueError for a value out of the setting's range.
    """
    board = ffi.new("bt_settings *")
    lib.bt_settings_reset(board)
    for setting, value in settings.items():
        if lib.bt_settings_set(board, setting, value) != wire.Error.OK:
            spec = wire.SETTINGS[setting]
            raise ValueError(f"{setting.name} is {value}, expected {spec.low} to {spec.high} {spec.unit}")
    return board


def reference_q4(counts: NDArray[np.uint16], tare_q4: NDArray[np.uint16], settings: Settings) -> Results:
    """The results of firmware/reference, Lin 2013 Eq 1-4 in float64, from the integers of FRAME messages, both (n, 19).

    Raises ValueError for other shapes or ranges.
    """
    raw = integers("counts", counts, np.uint16, None, ELECTRODES)
    tare_q4 = integers("tare_q4", tare_q4, np.uint16, len(raw), ELECTRODES)
    gains = formula_settings(settings)
    out = [np.empty((len(raw), 3), np.float64) for _ in range(3)]
    results = [ffi.from_buffer("double[]", array) for array in out]
    lib.lin2013_frames(len(raw), *pointers(raw, tare_q4), gains, *results)
    return Results(*out)


def formula_settings(settings: Settings) -> Any:
    """The C struct lin2013_settings, with gains in N per count."""
    return ffi.new(
        "lin2013_settings *",
        {
            "poc_weights": settings[wire.Setting.POC_WEIGHTS],
            "force_gain": [settings[s] / NN_PER_N for s in FORCE_GAINS],
            "torque_gain": [settings[s] / NN_PER_N for s in TORQUE_GAINS],
        },
    )


FORCE_GAINS = (wire.Setting.FORCE_GAIN_X_NN, wire.Setting.FORCE_GAIN_Y_NN, wire.Setting.FORCE_GAIN_Z_NN)
TORQUE_GAINS = (wire.Setting.TORQUE_GAIN_Y_NN, wire.Setting.TORQUE_GAIN_Z_NN)


def integers(name: str, values: Any, dtype: Any, *shape: int | None) -> NDArray[Any]:
    """A contiguous array of ``shape`` (None: any length) and ``dtype`` for C, which checks neither.

    Raises ValueError for another shape, for values that are not integers, and for ones that do not fit ``dtype``.
    """
    array = np.asarray(values)
    if array.ndim != len(shape) or any(want not in (None, have) for want, have in zip(shape, array.shape, strict=True)):
        wanted = ", ".join("n" if size is None else str(size) for size in shape)
        raise ValueError(f"{name} have shape {array.shape}, expected ({wanted})")
    if array.dtype != dtype:
        limits = np.iinfo(dtype)
        if array.dtype.kind not in "iu":
            raise ValueError(f"{name} are {array.dtype}, expected integers {limits.min} to {limits.max}")
        bad = (array < limits.min) | (array > limits.max)
        if bad.any():
            raise ValueError(f"{name} hold {array[bad][0]}, expected integers {limits.min} to {limits.max}")
    return np.ascontiguousarray(array, dtype)


def pointers(*arrays: NDArray[Any]) -> list[Any]:
    """Pointers for C to contiguous arrays of integers, which they keep alive."""
    return [ffi.from_buffer(f"{array.dtype}_t[]", array) for array in arrays]


def check_words(name: str, words: NDArray[Any]) -> NDArray[Any]:
    """``words`` as they are. Raises ValueError, naming the first bad row, unless all are 0..4095 or 0xFFFF."""
    bad = (words != wire.INVALID_COUNT) & ~((words >= 0) & (words <= FULL_SCALE_COUNT))
    if bad.any():
        raise ValueError(
            f"{name} row {np.argwhere(bad)[0][0]} holds {words[bad][0]}, expected 0..{FULL_SCALE_COUNT}, or 0xFFFF "
            "where missing"
        )
    return words
