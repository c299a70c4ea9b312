"""Frames as compact JSON, in the wire's own integers, so that nothing is rounded on its way to the page.

static/model.js reads these rows. ``FRAME_ROW`` names their columns and is sent first.
"""

from __future__ import annotations

import functools
import json
import operator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernels.unroll import unroll
from ..wire import messages_gen as wire
from ..wire import sensor_gen as sensor
from ..wire.batches import Batch
from ..wire.fields import INVALID_U8, MN_PER_N
from ..wire.frames import FORCE_LSB_PER_N, MNMM_PER_NMM, Q4_PER_COUNT, UM_PER_MM, StructArray, electrode_signals

#: ``signal_q4``: count - tare in 1/16 count (19), null where either is missing or not used. ``map_um``: the point of
#: contact on the unrolled skin, across and along, in um; null where it is invalid. ``applied_100un``:
#: PageReader.applied_n.
#: ``grip_mn``: normal, its half width, shear, its half width.
FRAME_ROW = (
    "finger", "seq", "t_us", "flags", "signal_q4", "pdc", "tac", "tdc", "poc_um", "force_100un", "torque_mnmm",
    "map_um", "applied_100un", "trust", "slip_level", "grip_mn",
)  # fmt: skip
_GRIP = ("normal_mn", "normal_half_mn", "shear_mn", "shear_half_mn")
PAC_ROW = ("finger", "seq", "t_us", "pac")

SCALES = {"signal_q4": Q4_PER_COUNT, "poc_um": UM_PER_MM, "force_100un": FORCE_LSB_PER_N, "torque_mnmm": MNMM_PER_NMM,
          "grip_mn": MN_PER_N}  # fmt: skip


def frame_rows(batch: Batch, applied_n: NDArray[np.float64] | None = None) -> list[str]:
    """One JSON text per FRAME and per heartbeat, oldest first; ``applied_n`` (n, 3) is of the FRAMEs."""
    applied: list[Any] = [None] * len(batch.wire)
    if applied_n is not None and np.isfinite(applied_n).all():
        applied = np.rint(applied_n * FORCE_LSB_PER_N).astype(int).tolist()
    messages, frames = batch.wire, batch.frames
    columns = zip(
        *(frames[name].tolist() for name in ("finger", "seq", "t_us", "flags")),
        with_null(signal_q4(messages), wire.INVALID_I32),
        *(with_null(messages[name], wire.INVALID_COUNT) for name in ("pdc", "tac", "tdc")),
        with_null(messages["poc_um"], wire.INVALID_I16),
        *(with_null(messages[name], wire.INVALID_I32) for name in ("force_100un", "torque_mnmm")),
        map_um(frames),
        applied,
        frames["trust"].tolist(),
        with_null(messages["slip_level"], INVALID_U8),
        with_null(np.column_stack([messages[name] for name in _GRIP]), wire.INVALID_COUNT),
        strict=True,
    )
    timed = [(row[2], compact(row)) for row in columns]
    for row in batch.idle:
        values = {name: row[name].item() for name in ("finger", "seq", "t_us", "flags", "trust")}
        values |= {name: with_null(row[name], wire.INVALID_COUNT) for name in ("pdc", "tdc")}
        timed.append((values["t_us"], compact([values.get(name) for name in FRAME_ROW])))
    return [text for _, text in sorted(timed, key=lambda item: item[0])]


def pac_rows(batch: Batch) -> list[str]:
    """One JSON text per PAC block."""
    rows = batch.pac
    columns = (rows[name].tolist() for name in PAC_ROW[:-1])
    return [compact(row) for row in zip(*columns, with_null(rows["pac"], wire.INVALID_COUNT), strict=True)]


def signal_q4(messages: StructArray) -> NDArray[np.int32]:
    """Signals of FRAME messages in 1/16 count, (n, 19); INVALID_I32 where count or tare is missing, or not used."""
    out = messages["electrodes_out"][:, None] >> np.arange(len(sensor.ELECTRODE_UM), dtype=np.uint32) & 1
    signals = np.where(out, np.nan, electrode_signals(messages) * Q4_PER_COUNT)
    return np.nan_to_num(signals, nan=wire.INVALID_I32).astype(np.int32)


def map_um(frames: StructArray) -> list[list[int] | None]:
    """The column ``map_um`` for FRAME_DTYPE rows."""
    points = np.column_stack(unroll(frames["poc_mm"])) * UM_PER_MM
    good = np.asarray(np.isfinite(points).all(axis=1))
    whole = np.rint(np.where(good[:, None], points, 0.0)).astype(np.int64).tolist()
    return [point if ok else None for point, ok in zip(whole, good.tolist(), strict=True)]


def with_null(values: NDArray[Any], invalid: int) -> Any:
    """``values`` as nested lists, or one of them as a number, with None for ``invalid``."""
    return np.where(values == invalid, None, values).tolist()  # type: ignore[call-overload]


def compact(value: Any) -> str:
    """JSON without spaces. Raises ValueError for NaN, which is not valid JSON."""
    return json.dumps(value, separators=(",", ":"), allow_nan=False)


def facts() -> dict[str, Any]:
    """The page's constants: geometry, scales, and texts for flags and tare states."""
    electrodes = np.array(sensor.ELECTRODE_UM) / UM_PER_MM
    across, along = unroll(electrodes)
    return {
        "frame_row": FRAME_ROW,
        "scales": SCALES,
        "electrodes": [
            {"name": name, "across_mm": a, "along_mm": b}
            for name, a, b in zip(sensor.ELECTRODE_NAMES, across.tolist(), along.tolist(), strict=True)
        ],
        "pac_hz": sensor.SLOT_HZ * sensor.SLOTS.count("PAC") / len(sensor.SLOTS),
        "pac_pa_per_count": sensor.PAC_PA_PER_COUNT,
        "thermistor": {
            "a": sensor.TDC_A,
            "b": sensor.TDC_B,
            "beta_k": sensor.TDC_BETA_K,
            "full_scale": sensor.FULL_SCALE_COUNT,
        },
        "flags": [
            {
                "mask": int(flag),
                "name": flag.name,
                "words": wire.FRAME_FLAG_DOC[int(flag)],
                "warns": bool(flag & WARNINGS),
            }
            for flag in wire.FrameFlags
        ],
        "trust": {int(t): {"name": t.name, "words": wire.TRUST_DOC[t]} for t in wire.Trust},
        "tare_states": {int(s): {"name": s.name, "words": wire.TARE_STATE_DOC[s]} for s in wire.TareState},
        "sensor_faults": {int(f): wire.SENSOR_FAULT_DOC[f] for f in wire.SensorFault},
        "tare_reasons": {int(r): {"name": r.name, "words": wire.TARE_REASON_DOC[r]} for r in wire.TareReason},
    }


#: Flags that count against the numbers: those that lower trust, or that STATUS latches.
WARNINGS = functools.reduce(operator.or_, wire.TRUST_FLAGS.values(), wire.LATCHED_FLAGS)
