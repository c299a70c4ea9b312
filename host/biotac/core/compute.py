"""Point of contact, force and torque of whole recordings, in float64.

In C (host/binding/compute.c): core.compiled.reference_q4 is Lin's part, and map.population has the population map's
formulas once more, in NumPy.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernels.compiled import FORCE_GAINS, TORQUE_GAINS, board_settings, default_settings, formula_settings
from ..map.board_map import BoardMap, opened
from ..wire import messages_gen as wire
from ..wire import sensor_gen as sensor
from ..wire.frames import StructArray
from ..wire.identity import columns_text
from ..wire.native import ffi, lib

_VECTORS = ("poc_mm", "force_n", "torque_nmm")
_NUMBERS = ("normal_n", "normal_half_n", "shear_n", "shear_half_n")
#: poc_mm, force_n, torque_nmm, and normal and shear of one frame; names, units and axes are as in FRAME_DTYPE.
RESULT_DTYPE = np.dtype([*((name, "<f8", (3,)) for name in _VECTORS), *((name, "<f8") for name in _NUMBERS)])
#: RESULT_DTYPE and ``torsion_nmm``, which a wrench map may have.
MAPPED_RESULT_DTYPE = np.dtype([*RESULT_DTYPE.descr, ("torsion_nmm", "<f8")])

_COUNT = np.dtype(np.uint16)
_TARE = np.dtype(np.float64)
_ELECTRODES = len(sensor.ELECTRODE_NAMES)
_FRAME_SHAPE = (_ELECTRODES,)
_ALL_GOOD = -1
_Q = wire.QuantityFlags
_RESULTS = _Q.POC | _Q.FORCE | _Q.TORQUE
_QUANTITY = {"poc_mm": _Q.POC, "force_n": _Q.FORCE, "torque_nmm": _Q.TORQUE, "torsion_nmm": _Q.TORQUE}
_QUANTITY |= dict.fromkeys(_NUMBERS, _Q.POC | _Q.FORCE)

# Looked up once: a call with one frame takes less time than a few of these would.
_buffer = ffi.from_buffer
_compute = lib.bt_compute
_compute_frame = lib.bt_compute_frame


def compute(
    counts: Any,
    tare: Any = None,
    settings: Mapping[wire.Setting, int] | None = None,
    out: StructArray | None = None,
    *,
    wrench_map: BoardMap | bytes | None = None,
    pdc_above_rest: Any = None,
    quantities: wire.QuantityFlags = _RESULTS,
) -> StructArray:
    """Results of recorded counts, as RESULT_DTYPE: shape (n,) for counts (n, 19), () for counts (19,).

    ``counts`` are integers 0..4095, or 0xFFFF where missing, which has no weight. uint16 is read in place, also from a
    field of a structured array. ``tare`` is (19,) or has the shape of ``counts``; it is 0..4095 counts, rounded to
    1/16 count as on the board. ``settings`` are those of a board. Omitted ones have the default, and a key that is not
    a biotac.Setting raises ValueError. By default, force comes from the population map
    (host/docs/guides/population.md); for Lin's three scales give {Setting.FORCE_MODEL: ForceModel.LIN}, or force gains
    of your own. ``out``, a contiguous RESULT_DTYPE array of the result's shape, is filled and returned: a reused buffer
    saves the page faults of a new one.

    ``wrench_map``, a map or its blob, gives the force in place of the gains, and also the torque if it has six axes or
    more; otherwise torque x is derived from the force. The result, and ``out``, are then MAPPED_RESULT_DTYPE: they have
    the torsion about the outward normal at the contact, NaN unless the map has it. ``pdc_above_rest``, which a map may
    need, is (n,) or one number, in counts, NaN where missing. Raises InputError for a blob that a board would refuse.

    ``quantities`` are those wanted of POC, FORCE and TORQUE; the others are NaN. Without FORCE and TORQUE no map is
    evaluated.

    ``compute(rows)``, with rows of FRAME_DTYPE as from ``load`` and ``Hand.read``, reads counts, tare and pressure
    there; an electrode without a tare has no weight. Rows do not contain the board's settings: give
    ``hand.board.settings()`` or ``Recording.settings`` with them. Without settings, rows that were plainly computed
    with other settings than the defaults are refused with a ValueError; ``settings={}`` means the defaults in any case.

    Half widths are those of a noiseless finger with a confirmed tare, and without pressure as a witness.

    Values without an answer are NaN: all that need a point of contact if no electrode has weight, and half widths if
    a count is missing, for which a board would use an estimate. Unlike the board, this does not round to wire units and
    never saturates. Raises ValueError for other shapes, types and ranges, naming the first bad row, the value and the
    expected range; ``out`` then holds no results.
    """
    given = counts
    if tare is None:
        counts, tare, pdc_above_rest = _of_rows(counts, pdc_above_rest)
    if settings is None and wrench_map is None:
        refuse_foreign_results(given)
    formulas = _formulas(() if settings is None else tuple(settings.items()), int(quantities))
    if wrench_map is not None:
        from ..map.published import by_map  # here: everybody would wait for it at `import biotac`

        by_lin = {**(settings or {}), wire.Setting.FORCE_MODEL: wire.ForceModel.LIN}  # the map replaces any force
        plain = compute(counts, tare, by_lin)
        shape = plain.shape
        out = np.empty(shape, MAPPED_RESULT_DTYPE) if out is None else _checked_out(out, shape, MAPPED_RESULT_DTYPE)
        out["torsion_nmm"] = np.nan
        for name in RESULT_DTYPE.names or ():
            out[name] = plain[name]
        if quantities & (_Q.FORCE | _Q.TORQUE):
            by_map(out, opened(wrench_map), counts, tare, pdc_above_rest)
        for name, quantity in _QUANTITY.items():
            if quantity & ~quantities:
                out[name] = np.nan
        return out
    # The fast path for one frame with the types of a live frame: there the checks would take longer than the maths.
    # Copying 38 and 152 bytes is faster than borrowing two buffers.
    try:
        is_frame = counts.dtype is _COUNT and tare.dtype is _TARE and counts.shape == _FRAME_SHAPE == tare.shape
    except AttributeError:
        is_frame = False
    if is_frame and (out is None or (out.dtype is RESULT_DTYPE and out.shape == () and out.flags.carray)):
        if out is None:
            out = np.empty((), RESULT_DTYPE)
        if not _compute_frame(formulas, counts.tobytes(), tare.tobytes(), _buffer(out)):
            raise ValueError(_explain(0, counts, tare))
        return out

    raw = _checked_counts(counts)
    base = _checked_tare(tare, raw.shape)
    out = np.empty(raw.shape[:-1], RESULT_DTYPE) if out is None else _checked_out(out, raw.shape[:-1])
    n = 1 if raw.ndim == 1 else len(raw)
    raw_stride = raw.strides[0] if raw.ndim == 2 else 0
    base_stride = base.strides[0] if base.ndim == 2 else 0
    if base.size == 0:  # no rows: NumPy may give a stride of 0, which means a single row to C
        return out
    bad = _compute(formulas, n, _address(raw), raw_stride, _address(base), base_stride, _buffer(out))
    if bad != _ALL_GOOD:
        raise ValueError(_explain(bad, raw, base))
    return out


def _of_rows(rows: Any, pdc_above_rest: Any) -> tuple[NDArray[np.uint16], NDArray[np.float64], Any]:
    """Counts (n, 19), tare (n, 19) and pressure above rest (n,) from rows that have these fields."""
    names = getattr(getattr(rows, "dtype", None), "names", None) or ()
    if "counts" not in names or "tare" not in names:
        raise ValueError("no tare: expected compute(counts, tare), or compute(rows) with fields counts and tare")
    unknown = np.isnan(rows["tare"])
    counts = np.where(unknown, np.uint16(wire.INVALID_COUNT), rows["counts"])
    tare = np.where(unknown, 0.0, rows["tare"]).astype(np.float64)
    if pdc_above_rest is None and {"pdc", "pdc_tare"} <= set(names):
        pdc_above_rest = np.where(rows["pdc"] == wire.INVALID_COUNT, np.nan, rows["pdc"] - rows["pdc_tare"])
    return counts, tare, pdc_above_rest


#: Beyond all rounding on a board: in mm, N and N mm, besides a hundredth of the value.
_UNLIKE = {"poc_mm": 0.02, "force_n": 0.01, "torque_nmm": 0.2}


def refuse_foreign_results(counts: Any) -> None:
    """Raise ValueError if ``counts``, rows or their field, come with results that the default settings do not give."""
    rows = counts if getattr(counts, "dtype", _COUNT).names else _rows_of_field(counts)
    if rows is None or not {"counts", "tare", "flags", "electrodes_out", *_UNLIKE} <= set(rows.dtype.names or ()):
        return
    rows = rows.reshape(-1)
    rows = rows[(rows["electrodes_out"] == 0) & (rows["counts"] <= sensor.FULL_SCALE_COUNT).all(axis=1)]
    # The point (0, 0, 0) is on no finger: nobody filled in results.
    rows = rows[((rows["flags"] & wire.FrameFlags.UNTARED) == 0) & (rows["poc_mm"] != 0).any(axis=1)]
    own = compute(rows, settings={})
    for name, within in _UNLIKE.items():
        seen, ours = rows[name], own[name]  # NaN, not asked for or invalid, is never off
        off = np.nan_to_num(np.abs(seen - ours) - within - 0.01 * np.abs(ours))
        if (off > 0).any():
            at, axis = np.unravel_index(off.argmax(), off.shape)
            found = f"{name} {'xyz'[axis]} is {seen[at, axis]:.2f} in row seq {rows['seq'][at]} of finger"
            raise ValueError(
                f"{found} {rows['finger'][at]}, but default settings give {ours[at, axis]:.2f}: the board had others. "
                "Give settings=hand.board.settings() or Recording.settings (finger_settings of a calibrated finger; "
                "wrench_map, if it has one), or settings={} if you mean the defaults"
            )


def _rows_of_field(counts: Any) -> StructArray | None:
    """The rows of which ``counts`` (n, 19) is a field, as ``frames["counts"]`` is; None if there are none."""
    rows = getattr(counts, "base", None)
    names = getattr(getattr(rows, "dtype", None), "names", None) or ()
    if rows is None or "counts" not in names or rows.ndim != 1 or counts.ndim != 2 or not len(counts):
        return None
    first, size = counts.ctypes.data - rows["counts"].ctypes.data, rows.itemsize
    return np.asarray(rows[first // size + counts.strides[0] // size * np.arange(len(counts))])


def per_frame(
    tare: Any, settings: Mapping[wire.Setting, int] | None = None, quantities: wire.QuantityFlags = _RESULTS
) -> Callable[[NDArray[np.uint16]], StructArray]:
    """compute() for a live stream: a function from one frame's counts, uint16 (19,), to its results.

    Tare and settings are checked once, and every call fills and returns the same RESULT_DTYPE array of shape (): copy
    copy a result that has to last. This saves half of the time that compute() needs for one frame. Raises ValueError as
    compute().
    """
    formulas = _formulas(() if settings is None else tuple(settings.items()), int(quantities))
    base = _checked_tare(tare, _FRAME_SHAPE)
    out = np.empty((), RESULT_DTYPE)
    compute(np.zeros(_FRAME_SHAPE, _COUNT), base, settings, out)  # raises for a tare that is out of range
    base_bytes, result, compute_frame, dtype, shape = base.tobytes(), _buffer(out), _compute_frame, _COUNT, _FRAME_SHAPE

    def results(counts: NDArray[np.uint16]) -> StructArray:
        if getattr(counts, "dtype", None) is not dtype or counts.shape != shape:
            seen = (
                f"{counts.dtype} of shape {counts.shape}" if isinstance(counts, np.ndarray) else type(counts).__name__
            )
            raise ValueError(f"counts are {seen}, expected uint16 of shape (19,)")
        if not compute_frame(formulas, counts.tobytes(), base_bytes, result):
            raise ValueError(_explain(0, counts, base))
        return out

    return results


_FORMULA_SETTINGS = (wire.Setting.POC_WEIGHTS, *FORCE_GAINS, *TORQUE_GAINS, wire.Setting.FORCE_MODEL)
_DEFAULTS = default_settings()


@lru_cache(maxsize=16)
def _formulas(items: tuple[tuple[Any, Any], ...], wanted: int) -> Any:
    """The bt_formulas for these settings and quantities. It is only read, so calls may share it."""
    settings = dict(items)
    if not wanted or wanted & ~_RESULTS:
        raise ValueError(f"quantities are {_Q(wanted)!r}, expected some of POC, FORCE and TORQUE")
    for key in settings:
        if key not in _DEFAULTS:
            raise ValueError(f"settings contain {key!r}, expected members of biotac.Setting, such as FORCE_GAIN_Z_NN")
    chosen = {key: int(settings.get(key, _DEFAULTS[key])) for key in _FORMULA_SETTINGS}
    board_settings(chosen)  # raises ValueError for a value out of range
    from ..map import population  # here: everybody would wait for it at `import biotac`

    formulas = ffi.new("bt_formulas *", {"lin": formula_settings(chosen)[0], "wanted": wanted})
    if population.in_force(chosen):
        formulas.population = population.compiled_coefficients()
    return formulas


def _checked_counts(counts: Any) -> NDArray[np.uint16]:
    """uint16 (n, 19) or (19,) with adjacent columns; other integer types are converted if in range."""
    raw = np.asarray(counts)
    if raw.ndim not in (1, 2) or raw.shape[-1] != _ELECTRODES:
        sp = columns_text(raw.shape[-1]) if raw.ndim else ""
        raise ValueError(f"counts have shape {raw.shape}, expected (n, 19) or (19,){sp}")
    if raw.dtype != _COUNT:
        if raw.dtype.kind not in "iu":
            raise ValueError(f"counts are {raw.dtype}, expected integers, preferably uint16")
        bad = np.argwhere(~_countlike(raw))
        if len(bad):
            raise ValueError(_explain(int(bad[0, 0]) if raw.ndim == 2 else 0, raw, np.zeros(_FRAME_SHAPE)))
        raw = raw.astype(_COUNT)
    return raw if raw.strides[-1] == _COUNT.itemsize else np.ascontiguousarray(raw)


def _checked_tare(tare: Any, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """float64 (19,) or ``shape`` with adjacent columns. The range is checked in C."""
    base = np.asarray(tare)
    if base.shape not in (_FRAME_SHAPE, shape):
        raise ValueError(f"the tare has shape {base.shape}, expected (19,) or {shape}, like the counts")
    if base.dtype.kind not in "iuf":
        raise ValueError(f"the tare is {base.dtype}, expected numbers, preferably float64")
    base = base.astype(_TARE, copy=False)
    return base if base.strides[-1] == _TARE.itemsize else np.ascontiguousarray(base)


def _checked_out(out: StructArray, shape: tuple[int, ...], dtype: np.dtype[np.void] = RESULT_DTYPE) -> StructArray:
    if not (isinstance(out, np.ndarray) and out.dtype == dtype and out.shape == shape and out.flags.carray):
        seen = f"{out.dtype} of shape {out.shape}" if isinstance(out, np.ndarray) else type(out).__name__
        name = "RESULT_DTYPE" if dtype == RESULT_DTYPE else "MAPPED_RESULT_DTYPE"
        raise ValueError(f"out is {seen}, expected a contiguous, writeable {name} of shape {shape}")
    # The dtype guarantees no alignment, and C stores doubles.
    if out.size and out.ctypes.data % 8:
        raise ValueError("out is not aligned to 8 bytes, as float64 needs; make it with numpy.empty")
    return out


def _address(array: NDArray[Any]) -> Any:
    """The address for C, valid while the caller holds the array; cffi's from_buffer wants a contiguous one."""
    return _buffer(array) if array.flags.c_contiguous else ffi.cast("void *", array.ctypes.data)


def _countlike(values: NDArray[Any]) -> NDArray[np.bool_]:
    good = ((values >= 0) & (values <= sensor.FULL_SCALE_COUNT)) | (values == wire.INVALID_COUNT)
    return np.asarray(good)


def _explain(row: int, counts: NDArray[Any], tare: NDArray[Any]) -> str:
    """The message about the value out of range in a row that C refused."""
    base = tare if tare.ndim == 1 else tare[row]
    bad = np.flatnonzero(~((base >= 0) & (base <= sensor.FULL_SCALE_COUNT)))
    if len(bad):
        where = "" if tare.ndim == 1 else f" of row {row}"
        name = sensor.ELECTRODE_NAMES[bad[0]]
        return f"the tare{where} has {name} = {base[bad[0]]}, expected 0..{sensor.FULL_SCALE_COUNT} counts"
    values = counts if counts.ndim == 1 else counts[row]
    first = np.flatnonzero(~_countlike(values))[0]
    where = "" if counts.ndim == 1 else f" of row {row}"
    return (
        f"the counts{where} have {sensor.ELECTRODE_NAMES[first]} = {values[first]}, expected "
        f"0..{sensor.FULL_SCALE_COUNT}, or {wire.INVALID_COUNT} for a missing electrode"
    )
