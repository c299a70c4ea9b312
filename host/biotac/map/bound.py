"""How far a board's results are from the intended map: measured, and bounded frame by frame.

The bound follows from the number formats alone (protocol/SPEC.md, Wrench maps, "Rounding"); no tolerance here
comes from a measurement.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..kernels import geometry as surface
from ..kernels.geometry import Floats
from ..wire import map_gen as _map
from ..wire.frames import Q4_PER_COUNT, tare_to_q4
from ..wire.map_gen import Gate, Kind
from .board_map import RING, BoardBlock, BoardMap
from .columns import ELECTRODES, REACH_MM, Signals, centroid_mm, gates, kinds
from .fitted import WrenchMap
from .float64 import FACTOR, Unrounded, result_units, tared_chunks, unit

_FIRST, _BEHIND = np.indices((ELECTRODES, len(RING) // ELECTRODES)).reshape(2, -1)
_CONDUCTANCE_OFF = 0.52  # relative error in 1 / FACTOR["conductance"], in addition to half a unit


@dataclass(frozen=True)
class Comparison:
    """Differences between the board's results and the float model's over ``rows``, and their proven bounds.

    RMS is that of the worst axis. ``force_mn_bound`` and ``torque_nmm_bound`` are the largest over the rows. Torque is
    None with three axes; torsion counts as torque.
    """

    rows: int
    bytes: int
    force_mn_rms: float
    force_mn_max: float
    force_mn_bound: float
    torque_nmm_rms: float | None
    torque_nmm_max: float | None
    torque_nmm_bound: float | None
    outside: int  # values beyond their bound; if there are any, the code is wrong


def compare(fitted: WrenchMap, board_map: BoardMap, counts: Floats, pdc: Floats | None = None) -> Comparison:
    """The board's results against ``fitted`` over recorded counts (n, 19); ``pdc`` (n,) in counts above rest.

    Both get a FRAME's values: whole counts, and tare and pressure in 1/16 count.
    """
    raw = np.rint(counts).astype(np.uint16)
    tare_q4 = tare_to_q4(np.broadcast_to(fitted.tare, raw.shape))
    pdc_q4 = np.zeros(len(raw), np.int32) if pdc is None else np.rint(pdc * Q4_PER_COUNT).astype(np.int32)
    on_frames = replace(fitted, tare=tare_q4[0] / Q4_PER_COUNT)
    truth = on_frames.predict(raw.astype(np.float64), pdc_q4 / Q4_PER_COUNT if fitted.with_pdc else None)
    results = np.column_stack(board_map.results(raw, tare_q4, pdc_q4))[:, : board_map.axes]
    off = np.abs(results / result_units(board_map.axes) - truth)
    limit = error_bound(board_map, fitted.blocks(), raw, tare_q4, pdc_q4)
    with_torque = board_map.axes > 3
    return Comparison(
        rows=len(raw),
        bytes=len(board_map.blob),
        force_mn_rms=1e3 * float(np.sqrt(np.square(off[:, :3]).mean(axis=0).max())),
        force_mn_max=1e3 * float(off[:, :3].max()),
        force_mn_bound=1e3 * float(limit[:, :3].max()),
        torque_nmm_rms=float(np.sqrt(np.square(off[:, 3:]).mean(axis=0).max())) if with_torque else None,
        torque_nmm_max=float(off[:, 3:].max()) if with_torque else None,
        torque_nmm_bound=float(limit[:, 3:].max()) if with_torque else None,
        outside=int((off > limit).sum()),
    )


def summary(fitted: WrenchMap, counts: Floats, pdc: Floats | None = None) -> dict[str, Any]:
    """compare() as JSON types; {"refused": reason} for a map that no board can hold."""
    try:
        return asdict(compare(fitted, fitted.on_board(), counts, pdc))
    except InputError as error:
        return {"refused": str(error)}


def summary_text(facts: dict[str, Any]) -> str:
    """summary() as a line of text."""
    if "refused" in facts:
        return f"on a board: {facts['refused']}"
    torque = f" and {facts['torque_nmm_rms']:.4f} N mm" if facts["torque_nmm_max"] is not None else ""
    return (
        f"on a board: {facts['bytes']} bytes, within {facts['force_mn_rms']:.2f} mN{torque} RMS of the float model "
        f"on all {facts['rows']} rows, {facts['force_mn_max']:.2f} mN at most"
    )


def error_bound(
    board_map: BoardMap,
    wanted: Unrounded | None,
    counts: npt.NDArray[np.uint16],
    tare_q4: npt.NDArray[np.uint16],
    pdc_q4: npt.NDArray[np.int32],
) -> Floats:
    """Bound (n, axes) on the board's error in N and N mm against exact() with ``wanted``."""
    off = [_bound_of(board_map, wanted, signals) for signals in tared_chunks(board_map, counts, tare_q4, pdc_q4)]
    return np.concatenate(off) / result_units(board_map.axes)


# ---- in the units of the board's integers ------------------------------------------------------
# ---- in the units of the board's integers ------------------------------------------------------


def _bound_of(board_map: BoardMap, wanted: Unrounded | None, signals: Signals) -> Floats:
    """The bound (n, axes) in the results' units, against the coefficients ``wanted``, or None: the integers' own."""
    columns, gate_values = kinds(signals), gates(signals.e)
    factors = {kind: columns[kind] * FACTOR[_map.KINDS[kind].of] for kind in _LINES if kind in columns}
    gate_off = _gates_off(signals, gate_values)
    total = np.zeros((len(signals.e), board_map.axes))
    for block in board_map.blocks:
        scale = 2.0 ** np.array(block.exponent)
        exact = block.coefficients.astype(np.float64)
        if wanted is not None:
            exact = wanted[block.kind, block.gate] / unit(block.kind, block.gate) * scale
        value, off = (_pairs if _map.KINDS[block.kind].shape == "pairs" else _line)(block, exact, factors)
        if block.gate != Gate.ONE:
            cut, gate = 2.0**_map.GATE_CUT, np.abs(gate_values[block.gate]) * 2.0**_map.GATE_Q
            off = off / cut + 0.5
            off = gate * off + gate_off[block.gate] * (np.abs(value) / cut + off)
        total += off / scale + 0.5
    return total


# The kinds with columns that are factors; pairs are products of them.
_LINES = (Kind.OFFSET, Kind.SIGNAL, Kind.COMPRESSION, Kind.BULGE, Kind.CONDUCTANCE, Kind.PRESSURE)


def _factor_off(kind: Kind, factor: Floats) -> Floats:
    """The error of each factor (n, columns): half a unit, and for a conductance that of the reciprocal."""
    if kind == Kind.OFFSET:
        return np.zeros_like(factor)
    share = _CONDUCTANCE_OFF / FACTOR["conductance"] if kind == Kind.CONDUCTANCE else 0.0
    return 0.5 + share * np.abs(factor)


def _line(block: BoardBlock, exact: Floats, factors: dict[Kind, Floats]) -> tuple[Floats, Floats]:
    """A block's sum (n, axes), and the bound on the sum's error."""
    factor = factors[block.kind]
    size, rounding = np.abs(block.coefficients), np.abs(exact - block.coefficients)
    return factor @ exact, np.abs(factor) @ rounding + _factor_off(block.kind, factor) @ size


def _pairs(block: BoardBlock, exact: Floats, factors: dict[Kind, Floats]) -> tuple[Floats, Floats]:
    """Like _line, row by row of the ring; each product loses less than a unit to a shift."""
    kind = Kind.SIGNAL if block.kind == Kind.SIGNAL_PAIRS else Kind.CONDUCTANCE
    factor, cut = factors[kind], 2.0**_map.ROW_CUT
    factor_off = _factor_off(kind, factor)
    value, off = np.zeros((2, len(factor), exact.shape[1]))
    for axis in range(exact.shape[1]):
        square, size, rounding = (
            _square(values[:, axis])
            for values in (exact, np.abs(block.coefficients), np.abs(exact - block.coefficients))
        )
        row = factor @ square.T
        row_off = np.abs(factor) @ rounding.T + factor_off @ size.T
        value[:, axis] = (row * factor).sum(axis=1) / cut
        off[:, axis] = ((np.abs(factor) + factor_off) * row_off + factor_off * np.abs(row)).sum(axis=1) / cut
        off[:, axis] += ELECTRODES
    return value, off


def _square(pairs: Floats) -> Floats:
    """The coefficients (190,) as (19, 19), with a row of the ring in each row."""
    square = np.zeros((ELECTRODES, ELECTRODES))
    square[_FIRST, (_FIRST + _BEHIND) % ELECTRODES] = pairs[RING]
    return square


def _gates_off(signals: Signals, value: dict[Gate, Floats]) -> dict[Gate, Floats]:
    """The error of each gate (n, 1): weights and positions are off by up to half a unit, the quotient is rounded."""
    centre = centroid_mm(signals.e)
    weight = (np.maximum(-signals.e, 0.0) + _map.FLOOR_COUNTS).sum(axis=1, keepdims=True) * 2.0**_map.SIGNAL_Q
    off = []
    for axis, reach in enumerate(REACH_MM):
        spread = np.abs(surface.ELECTRODE_MM[:, axis] - centre[:, axis, None]).sum(axis=1, keepdims=True) / reach
        position = 0.5 * 2.0 ** (_map.GATE_Q - _map.PLACE_Q)
        off.append(position + 0.5 + 0.5 * spread / (weight - 0.5 * ELECTRODES) * 2.0**_map.GATE_Q)
    x, y = off
    size = {gate: np.abs(values) for gate, values in value.items()}
    both = 2.0**-_map.GATE_Q
    return {
        Gate.X: x,
        Gate.Y: y,
        Gate.XX: 2.0 * size[Gate.X] * x + x * x * both + 0.5,
        Gate.XY: size[Gate.X] * y + size[Gate.Y] * x + x * y * both + 0.5,
        Gate.YY: 2.0 * size[Gate.Y] * y + y * y * both + 0.5,
    }
