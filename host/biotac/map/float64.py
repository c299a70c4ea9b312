"""A board's wrench map evaluated in float64, without any of the board's rounding."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np
import numpy.typing as npt

from ..kernels.geometry import Floats
from ..wire import map_gen as _map
from ..wire import messages_gen as wire
from ..wire.frames import FORCE_LSB_PER_N, MNMM_PER_NMM, Q4_PER_COUNT
from ..wire.map_gen import Gate, Kind
from .board_map import BoardMap
from .columns import PRESSURE_COUNTS, SIGNAL_COUNTS, Signals, summed, tared

_CHUNK_ROWS = 4096
#: Real coefficients (columns, axes) of each block, in units of the results.
Unrounded = Mapping[tuple[Kind, Gate], Floats]

# The board's factor for 1 in columns.kinds().
FACTOR = {
    "one": 2.0**_map.ONE_Q,
    "signal": 2.0**_map.SIGNAL_Q * SIGNAL_COUNTS,
    "conductance": 2.0**_map.CONDUCTANCE_Q,
    "pressure": 2.0**_map.PRESSURE_Q * PRESSURE_COUNTS,
}


def unit(kind: Kind, gate: Gate) -> float:
    """The result, in result units times 2^exponent, of a coefficient of 1 where column and gate are 1."""
    spec = _map.KINDS[kind]
    factor = FACTOR[spec.of]
    if spec.shape == "pairs":
        factor *= FACTOR[spec.of] / 2.0**_map.ROW_CUT
    return factor if gate == Gate.ONE else factor * 2.0 ** (_map.GATE_Q - _map.GATE_CUT)


def result_units(axes: int) -> Floats:
    """How many of the board's units make 1 N or 1 N mm, for each axis (axes,)."""
    return np.array(([FORCE_LSB_PER_N] * 3 + [MNMM_PER_NMM] * 4)[:axes], dtype=np.float64)


def replace_gains(
    board_map: BoardMap, wrench: Floats, poc_mm: Floats, force_n: Floats, torque_nmm: Floats, torsion_nmm: Floats
) -> None:
    """Put a map's ``wrench`` (n, axes), as from exact(), into the gains' results: (n, 3) each, torsion (n,).

    If the map has no torque, torque x is derived from the force with the lever to ``poc_mm`` (n, 3), and the other
    torques stay. If it has no torsion, that is NaN.
    """
    force_n[:] = wrench[:, :3]
    if board_map.axes > 3:
        torque_nmm[:] = wrench[:, 3:6]
    else:
        torque_nmm[:, 0] = derived_torque_x(poc_mm, wrench)
    torsion_nmm[:] = wrench[:, 6] if board_map.axes == _map.AXES_TORSION else np.nan


def derived_torque_x(poc_mm: Floats, force_n: Floats) -> Floats:
    """Torque x (n,) in N mm, from force (n, 3 or more) in N at ``poc_mm`` (n, 3)."""
    return poc_mm[:, 1] * force_n[:, 2] - poc_mm[:, 2] * force_n[:, 1]


def exact(
    board_map: BoardMap,
    counts: npt.NDArray[np.uint16],
    tare_q4: npt.NDArray[np.uint16],
    pdc_q4: npt.NDArray[np.int32],
    wanted: Unrounded | None = None,
) -> Floats:
    """The map's results without the board's rounding: (n, axes) in N and N mm; arguments as BoardMap.results().

    ``wanted`` are the coefficients before they were rounded for the board; None: the rounded ones.
    """
    if wanted is None:
        wanted = {
            (own.kind, own.gate): own.coefficients * (unit(own.kind, own.gate) / 2.0 ** np.array(own.exponent))
            for own in board_map.blocks
        }
    parts = [summed(wanted.items(), signals) for signals in tared_chunks(board_map, counts, tare_q4, pdc_q4)]
    limit = _map.RESULT_MAX
    return np.clip(np.concatenate(parts), -limit, limit) / result_units(board_map.axes)


def tared_chunks(
    board_map: BoardMap, counts: npt.NDArray[np.uint16], tare_q4: npt.NDArray[np.uint16], pdc_q4: npt.NDArray[np.int32]
) -> Iterator[Signals]:
    """Signals in chunks of frames, small enough to fit the columns in memory; arguments as exact()."""
    every = tared(counts, tare_q4)
    known = np.where(pdc_q4 == wire.INVALID_I32, np.nan, pdc_q4 / Q4_PER_COUNT)
    pressure = known if board_map.with_pdc else np.zeros(len(counts))
    for start in range(0, len(counts), _CHUNK_ROWS):
        rows = slice(start, start + _CHUNK_ROWS)
        yield Signals(every.e[rows], every.tare[rows], pressure[rows])
