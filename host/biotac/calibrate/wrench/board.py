"""A fitted map in the board's fixed point (core.map_quantise), and its comparison with the fit.

The rounding error is bounded frame by frame (``bound``), from protocol/SPEC.md, Wrench maps; no tolerance here comes
from a measurement.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ...core import map_quantise
from ...core.board_map import BoardMap
from ...core.geometry import Floats
from ...core.map_bound import bound_of
from ...core.map_float64 import Unrounded, result_units, tared_chunks
from ...errors import InputError
from ...wire import map_gen as _map
from ...wire.frames import Q4_PER_COUNT, tare_to_q4
from ...wire.map_gen import Gate, Kind
from . import features
from .fitted import WrenchMap
from .run import Run


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
    outside: int  # values beyond their own bound; if there are any, the code is wrong


# ---- from float to integers --------------------------------------------------------------------


def quantise(its: WrenchMap, *, serial: str = "", made_s: int = 0) -> BoardMap:
    """The map for a board.

    Raises InputError when a coefficient is beyond the board's formats (it names the block), when all are 0, or when
    there is no room for all of them.
    """
    axes = len(its.axes)
    found = _merged(its)
    blocks = tuple(
        map_quantise.block(kind, gate, values, its.axes)
        for (kind, gate), values in found.items()
        if np.any(values != 0.0)
    )
    if not blocks:
        raise InputError("every coefficient of the map is 0: expected a fitted map; calibrate again")
    result = BoardMap(axes, blocks, serial, made_s)
    size = _map.HEADER_BYTES + sum(_map.BLOCK_BYTES + 2 * axes * _map.KINDS[b.kind].halves for b in blocks)
    if size > _map.MAX_BYTES:
        raise InputError(
            f"the map takes {size} bytes: expected at most {_map.MAX_BYTES}, which fit a board; choose a smaller model"
        )
    return result


def _merged(its: WrenchMap) -> Unrounded:
    """Coefficients by block, in the board's units for results."""
    unit = result_units(len(its.axes))
    found: Unrounded = {}
    at = 0
    for block in features.blocks(with_pdc=its.with_pdc):
        values = its.coefficients[at : at + block.width]
        found[block.kind, block.gate] = values * unit
        at += block.width
    found[Kind.OFFSET, Gate.ONE] = its.coefficients[at:] * unit
    for gate in Gate:
        # e = min(e, 0) + max(e, 0): where both are present anyway, this saves a block
        split = (Kind.COMPRESSION, gate), (Kind.BULGE, gate)
        if (Kind.SIGNAL, gate) in found and all(part in found and np.any(found[part] != 0.0) for part in split):
            signal = found.pop((Kind.SIGNAL, gate))
            for part in split:
                found[part] = found[part] + signal
    return found


def bound(
    its: BoardMap,
    model: WrenchMap | None,
    counts: npt.NDArray[np.uint16],
    tare_q4: npt.NDArray[np.uint16],
    pdc_q4: npt.NDArray[np.int32],
) -> Floats:
    """Bound (n, axes) on the board's error in N and N mm: against ``model``, or without one against exact()."""
    wanted = _merged(model) if model is not None else None
    off = np.concatenate([bound_of(its, wanted, s) for s in tared_chunks(its, counts, tare_q4, pdc_q4)])
    return off / result_units(its.axes)


# ---- comparison --------------------------------------------------------------------------------


def compare(model: WrenchMap, its: BoardMap, counts: Floats, pdc: Floats | None = None) -> Comparison:
    """The board's results against ``model`` over recorded counts (n, 19); ``pdc`` (n,) in counts above rest.

    Both get what a FRAME holds: whole counts, and tare and pressure in 1/16 count.
    """
    raw = np.rint(counts).astype(np.uint16)
    tare_q4 = tare_to_q4(np.broadcast_to(model.tare, raw.shape))
    pdc_q4 = np.zeros(len(raw), np.int32) if pdc is None else np.rint(pdc * Q4_PER_COUNT).astype(np.int32)
    on_frames = replace(model, tare=tare_q4[0] / Q4_PER_COUNT)
    truth = on_frames.predict(raw.astype(np.float64), pdc_q4 / Q4_PER_COUNT if model.with_pdc else None)
    force, torque, torsion = its.results(raw, tare_q4, pdc_q4)
    got = np.column_stack([force, torque, torsion])[:, : its.axes] / result_units(its.axes)
    off = np.abs(got - truth)
    limit = bound(its, model, raw, tare_q4, pdc_q4)
    with_torque = its.axes > 3
    return Comparison(
        rows=len(raw),
        bytes=len(its.blob),
        force_mn_rms=1e3 * float(np.sqrt(np.square(off[:, :3]).mean(axis=0).max())),
        force_mn_max=1e3 * float(off[:, :3].max()),
        force_mn_bound=1e3 * float(limit[:, :3].max()),
        torque_nmm_rms=float(np.sqrt(np.square(off[:, 3:]).mean(axis=0).max())) if with_torque else None,
        torque_nmm_max=float(off[:, 3:].max()) if with_torque else None,
        torque_nmm_bound=float(limit[:, 3:].max()) if with_torque else None,
        outside=int((off > limit).sum()),
    )


def summary(model: WrenchMap, run: Run) -> dict[str, Any]:
    """compare() over a run as JSON types; {"refused": reason} for a map that no board can hold."""
    try:
        return asdict(compare(model, quantise(model), run.counts, run.pdc))
    except InputError as error:
        return {"refused": str(error)}


def words(facts: dict[str, Any]) -> str:
    """summary() as a line of text."""
    if "refused" in facts:
        return f"on a board: {facts['refused']}"
    torque = f" and {facts['torque_nmm_rms']:.4f} N mm" if facts["torque_nmm_max"] is not None else ""
    return (
        f"on a board: {facts['bytes']} bytes, within {facts['force_mn_rms']:.2f} mN{torque} RMS of the float model "
        f"on all {facts['rows']} rows, {facts['force_mn_max']:.2f} mN at most"
    )
