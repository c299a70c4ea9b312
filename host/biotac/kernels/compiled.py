"""The compiled firmware core and its float64 reference, over whole arrays.

Both run over the same recorded integers, so that any difference comes from arithmetic alone.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..wire import messages_gen as wire
from ..wire.identity import columns_text
from ..wire.native import ffi, lib
from ..wire.sensor_gen import ELECTRODE_NAMES, FULL_SCALE_COUNT

NN_PER_N = 1e9
ELECTRODES = len(ELECTRODE_NAMES)
Settings = dict[wire.Setting, int]
BoardResults = tuple[NDArray[np.int16], NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], NDArray[np.uint32]]


class Results(NamedTuple):
    """poc_mm, force_n, torque_nmm, each (n, 3) float64; NaN where there is no answer."""

    poc_mm: NDArray[np.float64]
    force_n: NDArray[np.float64]
    torque_nmm: NDArray[np.float64]


def default_settings() -> Settings:
    """The settings that a board starts with."""
    return {setting: spec.default for setting, spec in wire.SETTINGS.items()}


def on_board_q4(
    counts: NDArray[np.uint16],
    tare_q4: NDArray[np.uint16],
    settings: Settings,
    own_map: Any = ffi.NULL,
    pdc_above_rest_q4: NDArray[np.int32] | None = None,
) -> BoardResults:
    """Run the on-board integer kernels on the integers of FRAME messages, both (n, 19).

    ``own_map``, a struct bt_map, is in force; it may need ``pdc_above_rest_q4`` (n,), -2^31 where missing. Returns
    poc_um, force_100un, torque_mnmm, each (n, 3), torsion_mnmm, which only a map gives, and the kernel's flags (n,).
    Raises ValueError for other shapes or ranges.
    """
    raw, tare_q4, pdc = _checked(counts, tare_q4, pdc_above_rest_q4)
    n = len(raw)
    kernel = ffi.new("bt_solve_settings *", lib.bt_solve_settings_from(board_settings(settings)))
    kernel.map = own_map
    poc_um, torsion_mnmm, flags = np.empty((n, 3), np.int16), np.empty(n, np.int32), np.empty(n, np.uint32)
    force_100un, torque_mnmm = np.empty((2, n, 3), np.int32)
    results = c_pointers(poc_um, force_100un, torque_mnmm, torsion_mnmm, flags)
    lib.bt_kernel_frames(n, *c_pointers(raw, tare_q4, pdc), kernel, *results)
    return poc_um, force_100un, torque_mnmm, torsion_mnmm, flags


def map_results_q4(
    counts: NDArray[np.uint16], tare_q4: NDArray[np.uint16], pdc_above_rest_q4: NDArray[np.int32], own_map: Any
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """A struct bt_map's own results: force_100un, torque_mnmm (n, 3), torsion_mnmm (n,).

    And the lesson's factors (n, 10).
    """
    given = _checked(counts, tare_q4, pdc_above_rest_q4)
    n = len(given[0])
    force_100un, torque_mnmm = np.empty((2, n, 3), np.int32)
    torsion_mnmm = np.empty(n, np.int32)
    factors = np.empty((n, lib.BT_FACTORS_OF_LESSON), np.int32)
    lib.bt_map_frames(n, *c_pointers(*given), own_map, *c_pointers(force_100un, torque_mnmm, torsion_mnmm, factors))
    return force_100un, torque_mnmm, torsion_mnmm, factors


def _checked(counts: Any, tare_q4: Any, pdc_above_rest_q4: Any) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    raw = integers("counts", counts, np.uint16, None, ELECTRODES)
    tare_q4 = integers("tare_q4", tare_q4, np.uint16, len(raw), ELECTRODES)
    if pdc_above_rest_q4 is None:
        pdc_above_rest_q4 = np.full(len(raw), wire.INVALID_I32, np.int32)
    return raw, tare_q4, integers("pdc_above_rest_q4", pdc_above_rest_q4, np.int32, len(raw))


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
    lib.bt_pressure_forces(len(out), *c_pointers(filtered_q4, tare_q4), gain_nn, *c_pointers(out))
    return out


def grip_mn(poc_um: NDArray[np.int16], force_100un: NDArray[np.int32]) -> NDArray[np.uint16]:
    """The board's normal and shear (n, 2) in mN, 65535 where invalid, from integers of FRAME messages, (n, 3) each."""
    frame = ffi.new("bt_msg_frame *")
    margin = ffi.new("bt_margin *")
    nothing = ffi.new("bt_uncertainty *", {"margin": margin})
    out = np.empty((len(poc_um), 2), np.uint16)
    for k, (frame.poc_um, frame.force_100un) in enumerate(zip(poc_um.tolist(), force_100un.tolist(), strict=True)):
        lib.bt_grip(nothing, frame)
        out[k] = frame.normal_mn, frame.shear_mn
    return out


def c_pointers(*arrays: NDArray[Any]) -> list[Any]:
    """The memory of contiguous arrays for C, which must not outlive them; that of structured ones as bytes."""
    kinds = {"V": "uint8_t", "f": "double"}
    return [ffi.from_buffer(f"{kinds.get(a.dtype.kind, f'{a.dtype.name}_t')}[]", a) for a in arrays]


def completed(messages: NDArray[Any]) -> NDArray[Any]:
    """FRAME messages (n,), with the counts that the board uses in place of bounds and of electrodes that are out."""
    without = np.flatnonzero((messages["electrodes_out"] != 0) | (messages["counts"] == 0).any(axis=1))
    if len(without):
        messages = messages.copy()
    for k in without.tolist():
        counts = np.empty(ELECTRODES, np.uint16)
        given = [np.ascontiguousarray(messages[name][k], np.uint16) for name in ("counts", "tare_q4")]
        lib.bt_complete(*c_pointers(*given), int(messages["electrodes_out"][k]), *c_pointers(counts))
        messages["counts"][k] = counts
    return messages


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
    out = np.empty((3, len(raw), 3), np.float64)
    lib.lin2013_frames(len(raw), *c_pointers(raw, tare_q4), formula_settings(settings), *c_pointers(*out))
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
    array = _shaped(name, values, shape)
    if array.dtype != dtype:
        limits = np.iinfo(dtype)
        if array.dtype.kind not in "iu":
            raise ValueError(f"{name} are {array.dtype}, expected integers {limits.min} to {limits.max}")
        bad = (array < limits.min) | (array > limits.max)
        if bad.any():
            raise ValueError(f"{name} hold {array[bad][0]}, expected integers {limits.min} to {limits.max}")
    return np.ascontiguousarray(array, dtype)


def checked_words(name: str, values: Any, *shape: int | None) -> NDArray[np.uint16]:
    """The sensor's words for C, an array as integers() gives.

    Raises ValueError, naming the first bad row, unless they are integers 0..4095 or 0xFFFF.
    """
    array = _shaped(name, values, shape)
    if array.dtype.kind not in "iu":
        raise ValueError(f"{name} are {array.dtype}, expected integers")
    bad = (array != wire.INVALID_COUNT) & ~((array >= 0) & (array <= FULL_SCALE_COUNT))
    if bad.any():
        raise ValueError(
            f"{name} row {np.argwhere(bad)[0][0]} holds {array[bad][0]}, expected 0..{FULL_SCALE_COUNT}, or 0xFFFF "
            "where missing"
        )
    return np.ascontiguousarray(array, np.uint16)


def _shaped(name: str, values: Any, shape: tuple[int | None, ...]) -> NDArray[Any]:
    array = np.asarray(values)
    if array.ndim != len(shape) or any(want not in (None, have) for want, have in zip(shape, array.shape, strict=True)):
        wanted = ", ".join("n" if size is None else str(size) for size in shape) + ("," if len(shape) == 1 else "")
        sp = columns_text(array.shape[-1]) if array.ndim and shape[-1] == ELECTRODES else ""
        raise ValueError(f"{name} have shape {array.shape}, expected ({wanted}){sp}")
    return array


def trust_of(frames: NDArray[Any]) -> NDArray[np.uint8]:
    """Trust (n,) of FRAME messages (n,), as the board gives it by their flags, force and normal's interval."""
    columns = (frames[name].tolist() for name in ("flags", "normal_mn", "normal_half_mn"))
    out = np.fromiter((lib.bt_trust(*row) for row in zip(*columns, strict=True)), np.uint8, len(frames))
    out[frames["force_100un"][:, 2] == wire.INVALID_I32] = wire.Trust.NONE
    return out
