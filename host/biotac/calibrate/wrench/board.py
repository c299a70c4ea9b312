"""A fitted map in the board's fixed point: made, and compared with the fit.

Quantised by one rule: an axis of a block gets the smallest exponent at which its coefficients pass the
board's own bound, and they are rounded to that. What that costs is computed frame by frame (``bound``),
from protocol/SPEC.md, Wrench maps; nothing here is measured and then called a tolerance.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...core.board_map import BoardBlock, BoardMap
from ...core.geometry import Floats
from ...core.map_columns import ELECTRODES, Signals, gates, kinds
from ...core.map_float64 import FACTOR, Q4, factor_product, result_units, tared
from ...errors import InputError
from ...wire import map_gen as _map
from ...wire.frames import tare_to_q4
from ...wire.map_gen import Gate, Kind
from . import features
from .fitted import WrenchMap
from .run import Run

_UPPER = np.triu_indices(ELECTRODES)
_ROW_COLUMNS = np.arange(ELECTRODES, 0, -1)  # of each row of pairs


@dataclass(frozen=True)
class Comparison:
    """Greatest differences of the board's results from the float model's over ``rows``, and what was proved of them.

    ``force_mn_bound`` and ``torque_nmm_bound`` are the largest over the rows. Torque is None with three axes, and
    torsion counts as torque.
    """

    rows: int
    bytes: int
    force_mn_max: float
    force_mn_bound: float
    torque_nmm_max: float | None
    torque_nmm_bound: float | None
    outside: int  # rows and axes beyond their own bound: none, or the code is wrong

    def as_dict(self) -> dict[str, float | int | None]:
        """For JSON."""
        return dataclasses.asdict(self)


# ---- from float to integers --------------------------------------------------------------------


def quantise(its: WrenchMap, *, serial: str = "", made_s: int = 0) -> BoardMap:
    """The map for a board. Raises InputError, naming the block, when a coefficient is beyond the board's formats, and
    when there is no room for all of them.
    """
    axes = len(its.axes)
    found = _merged(its)
    blocks = tuple(
        _quantised(kind, gate, values, its.axes) for (kind, gate), values in found.items() if np.any(values != 0.0)
    )
    if not blocks:
        raise InputError("every coefficient of the map is 0: expected a fitted map; calibrate again")
    result = BoardMap(axes, blocks, serial, made_s)
    size = _map.HEADER_BYTES + sum(_map.BLOCK_BYTES + 4 * b.coefficients.size for b in blocks)
    if size > _map.MAX_BYTES:
        raise InputError(
            f"the map takes {size} bytes: expected at most {_map.MAX_BYTES}, a board's room; choose a smaller model"
        )
    return result


def _merged(its: WrenchMap) -> dict[tuple[Kind, Gate], Floats]:
    """Coefficients by block, in 2^-16 of the result's unit per 2^-16 of the columns' factors."""
    unit = result_units(len(its.axes)) * 2.0**_map.RESULT_Q
    found: dict[tuple[Kind, Gate], Floats] = {}
    at = 0
    for block in features.blocks(with_pdc=its.with_pdc):
        values = its.coefficients[at : at + block.width]
        found[block.kind, block.gate] = values * unit / factor_product(block.kind)
        at += block.width
    found[Kind.OFFSET, Gate.ONE] = its.coefficients[at:] * unit / factor_product(Kind.OFFSET)
    for gate in Gate:
        # e = min(e, 0) + max(e, 0): where both are there anyway, a block less to compute
        split = (Kind.COMPRESSION, gate), (Kind.BULGE, gate)
        if (Kind.SIGNAL, gate) in found and all(part in found and np.any(found[part] != 0.0) for part in split):
            signal = found.pop((Kind.SIGNAL, gate))
            for part in split:
                found[part] = found[part] + signal
    return found


def _quantised(kind: Kind, gate: Gate, values: Floats, names: tuple[str, ...]) -> BoardBlock:
    exponents, columns = [], []
    for axis, name in enumerate(names):
        for exponent in range(_map.EXPONENT_MAX + 1):
            scaled = np.rint(values[:, axis] / 2.0**exponent)
            if _row_sums(kind, np.abs(scaled)).max() <= _map.COEFFICIENT_SUM_MAX:
                break
        else:
            most = _map.RESULT_MAX / result_units(len(names))[axis]
            raise InputError(
                f"coefficients of {kind.name} x {gate.name} for {name} add up to {float(np.abs(scaled).sum()):.3g} "
                f"units: expected at most {_map.COEFFICIENT_SUM_MAX:.3g}, with which full scale already is far beyond "
                f"the {most:.0f} a result can hold; fit with more rows or a larger lambda"
            )
        exponents.append(exponent)
        columns.append(scaled.astype(np.int64))
    return BoardBlock(kind, gate, tuple(exponents), np.column_stack(columns))


def _row_sums(kind: Kind, magnitudes: Floats) -> Floats:
    """Sums that the board's check is about: one of the block, or one a row of pairs."""
    if _map.KINDS[kind].shape != "pairs":
        total: Floats = magnitudes.sum(axis=0, keepdims=True)
        return total
    first = np.cumsum(_ROW_COLUMNS) - _ROW_COLUMNS
    sums: Floats = np.add.reduceat(magnitudes, first, axis=0)
    return sums


# ---- what the board's rounding can cost --------------------------------------------------------

GATE_OFF = {Gate.ONE: 0.0, Gate.X: 0.6, Gate.Y: 0.6, Gate.XX: 2.6, Gate.XY: 2.6, Gate.YY: 2.6}  # in 2^-19
RATIO_OFF = 1.15 * 2.0 ** -(_map.CONDUCTANCE_FINE_BITS + 16)  # 1.15 units of 2^-24, per unit of a coefficient


def bound(
    its: BoardMap,
    model: WrenchMap | None,
    counts: npt.NDArray[np.uint16],
    tare_q4: npt.NDArray[np.uint16],
    pdc_q4: npt.NDArray[np.int32],
) -> Floats:
    """How far the board's result may be off (n, axes) in N and N mm: from ``model``, or without one from exact()."""
    wanted = _merged(model) if model is not None else {}
    off = np.concatenate([_bound(its, wanted, s) for s in tared(its, counts, tare_q4, pdc_q4)])
    result: Floats = off / result_units(its.axes)
    return result


def _bound(its: BoardMap, wanted: dict[tuple[Kind, Gate], Floats], signals: Signals) -> Floats:
    kind_columns, gate_values = kinds(signals), gates(signals.e)
    total = np.full((len(signals.e), its.axes), 0.5)
    for block in its.blocks:
        scale = 2.0 ** np.array(block.exponent)
        rounded = np.zeros(block.coefficients.shape)
        if wanted:
            rounded = np.abs(wanted[block.kind, block.gate] / scale - block.coefficients)
        columns = kind_columns[block.kind] * factor_product(block.kind)
        off = np.abs(columns) @ rounded + _block_off(block, kind_columns)
        size = np.abs(columns @ block.coefficients) + off
        gate = np.abs(gate_values[block.gate])
        gated = gate * off + GATE_OFF[block.gate] / 2.0**_map.GATE_Q * size + (block.gate != Gate.ONE) * 0.5
        total += gated * scale / 2.0**_map.RESULT_Q
    return total


def _sum_off(columns: npt.ArrayLike, *, fine: bool) -> Floats:
    """Of a sum over so many columns: products cut downwards, which half of their number makes up for on average.

    With fine bits, what they leave away (half a unit each) and the cut of their sum.
    """
    n = np.asarray(columns, dtype=np.float64)
    off: Floats = n + 2.0 if fine else (n + 1.0) / 2.0
    return off


def _block_off(block: BoardBlock, kind_columns: dict[Kind, Floats]) -> Floats:
    """By how much a block's integer may be off (n, axes) with the coefficients it has."""
    spec, n = _map.KINDS[block.kind], len(kind_columns[Kind.SIGNAL])
    fine = spec.of == "conductance"
    size = np.abs(block.coefficients).astype(np.float64)
    if spec.shape == "one":
        return np.ones((n, size.shape[1]))
    if spec.shape == "electrodes":
        off = _sum_off(ELECTRODES, fine=fine) + fine * RATIO_OFF * size.sum(axis=0)
        return np.broadcast_to(off, (n, len(off)))
    factors = np.abs(kind_columns[Kind.CONDUCTANCE if fine else Kind.SIGNAL]) * FACTOR[spec.of] / 2.0**16
    row_off = _sum_off(_ROW_COLUMNS, fine=fine)[:, None] + fine * RATIO_OFF * _row_sums(block.kind, size)
    sums: Floats = factors @ row_off + _sum_off(ELECTRODES, fine=fine)
    if fine:
        for axis in range(size.shape[1]):
            square = np.zeros((ELECTRODES, ELECTRODES))
            square[_UPPER] = size[:, axis]
            # the other factor of each product, off by a unit too
            sums[:, axis] += RATIO_OFF * (factors @ square.T + row_off[:, axis]).sum(axis=1)
    return sums


# ---- both beside each other --------------------------------------------------------------------


def compare(model: WrenchMap, its: BoardMap, counts: Floats, pdc: Floats | None = None) -> Comparison:
    """The board's results against ``model`` over recorded counts (n, 19); ``pdc`` (n,) counts above rest.

    Both take what a FRAME holds: whole counts, tare and pressure in 1/16 count.
    """
    raw = np.rint(counts).astype(np.uint16)
    tare_q4 = tare_to_q4(np.broadcast_to(model.tare, raw.shape))
    pdc_q4 = np.zeros(len(raw), np.int32) if pdc is None else np.rint(pdc * Q4).astype(np.int32)
    on_frames = dataclasses.replace(model, tare=tare_q4[0] / Q4)
    truth = on_frames.predict(raw.astype(np.float64), pdc_q4 / Q4 if model.with_pdc else None)
    force, torque, torsion = its.results(raw, tare_q4, pdc_q4)
    got = np.column_stack([force, torque, torsion])[:, : its.axes] / result_units(its.axes)
    off = np.abs(got - truth)
    limit = bound(its, model, raw, tare_q4, pdc_q4)
    with_torque = its.axes > 3
    return Comparison(
        rows=len(raw),
        bytes=len(its.blob),
        force_mn_max=1e3 * float(off[:, :3].max()),
        force_mn_bound=1e3 * float(limit[:, :3].max()),
        torque_nmm_max=float(off[:, 3:].max()) if with_torque else None,
        torque_nmm_bound=float(limit[:, 3:].max()) if with_torque else None,
        outside=int((off > limit).sum()),
    )


def summary(model: WrenchMap, run: Run) -> dict[str, Any]:
    """compare() over a run as JSON; {"refused": in words} for a map that no board can hold."""
    try:
        return compare(model, quantise(model), run.counts, run.pdc).as_dict()
    except InputError as error:
        return {"refused": str(error)}


def words(facts: dict[str, Any]) -> str:
    """summary() as a line."""
    if "refused" in facts:
        return f"on a board: {facts['refused']}"
    torque = f" and {facts['torque_nmm_max']:.5f} N mm" if facts["torque_nmm_max"] is not None else ""
    return (
        f"on a board: {facts['bytes']} bytes, within {facts['force_mn_max']:.3f} mN{torque} of the float model "
        f"on all {facts['rows']} rows"
    )
