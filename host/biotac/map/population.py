"""The force of an uncalibrated finger, in float64, by the population map that comes with the package.

The board has the same map in 16 bits, firmware/core/map/population.c, made by board_map(). This module reads the
coefficients as trained, and makes the columns as training does; boards are checked against it. biotac.compute runs the
same formulas in host/binding/population_float64.c. See SPEC.md, Population map.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
import numpy.typing as npt

from ..core.compiled import FORCE_GAINS
from ..core.geometry import Floats
from ..wire import messages_gen as wire
from ..wire.frames import FORCE_LSB_PER_N
from ..wire.map_gen import Gate, Kind
from ..wire.native import ffi
from .board_map import BoardMap
from .columns import SIGNAL_COUNTS, Signals, split, summed, tared
from .float64 import derived_torque_x
from .quantise import quantise

SHIPPED = "population.json"
Block = tuple[Kind, Gate, Floats]

ALL = 256  # the share 1
_NOISE_Q4 = 8 * 16
_SUM_BITS = 15
_CHUNK_ROWS = 4096
_COMPILED = [
    *((kind, gate) for gate in (Gate.ONE, Gate.X, Gate.Y) for kind in (Kind.COMPRESSION, Kind.BULGE)),
    (Kind.CONDUCTANCE, Gate.ONE),
    (Kind.CONDUCTANCE_PAIRS, Gate.ONE),
]


def in_force(settings: Mapping[wire.Setting, int]) -> bool:
    """Whether the force of a finger with these settings and no wrench map comes from the population map."""
    model = settings.get(wire.Setting.FORCE_MODEL, wire.SETTINGS[wire.Setting.FORCE_MODEL].default)
    own = any(settings.get(gain, wire.SETTINGS[gain].default) != wire.SETTINGS[gain].default for gain in FORCE_GAINS)
    return model == wire.ForceModel.POPULATION and not own


def shipped() -> str:
    """The package's population map as JSON text (biotac.calibrate.population.map_file)."""
    return resources.files(__package__).joinpath(SHIPPED).read_text(encoding="utf-8")


@cache
def blocks() -> list[Block]:
    """Kind, gate and coefficients (columns, 3) in N of each block."""
    facts = json.loads(shipped())
    named = [(Kind[kind], Gate[gate]) for kind, gate in facts["blocks"]]
    coefficients = np.array(facts["coefficients_n_and_variance"], dtype=np.float64)[:, :3]
    return [(*name, values) for name, values in split(named, coefficients).items()]


def board_map(each: list[Block]) -> BoardMap:
    """The blocks as a board's map. Raises InputError when they do not fit the board's formats."""
    return quantise({(kind, gate): values * FORCE_LSB_PER_N for kind, gate, values in each})


def alone(signals: Signals) -> Floats:
    """The map's force (n, 3) in N, whatever its share."""
    return summed(blocks(), signals)


def share(signals: Signals) -> npt.NDArray[np.int64]:
    """The share of the force that comes from the map (n,), in 1/256; defined in integers, so that all boards agree.

    With s = |e| less 8 counts, (sum s)^2 / sum s^2 says over how many electrodes a signal spreads. The share is all
    from 4.5 electrodes on, and nothing up to 3.
    """
    size = np.rint(16 * np.abs(signals.e)).astype(np.int64)
    beyond = np.maximum(size - _NOISE_Q4, 0) >> 3  # half counts
    total, energy = beyond.sum(axis=1), (beyond**2).sum(axis=1)
    shift = np.maximum(np.ceil(np.log2(total + 1.0)).astype(np.int64) - _SUM_BITS, 0)
    square, energy = (total >> shift) ** 2, energy >> 2 * shift
    divisor = np.maximum((3 * energy + 63) >> 6, 1)
    part = np.minimum((8 * (square - 3 * energy) + divisor // 2) // divisor, ALL)
    enough = (square // 2 >= 9 * energy // 4) & (square > 0)
    return np.where(enough, ALL, np.where(square <= 3 * energy, 0, part))


def replace_force(
    counts: npt.NDArray[np.uint16], tare_q4: npt.NDArray[np.uint16], poc_mm: Floats, force_n: Floats, torque_nmm: Floats
) -> None:
    """Blend the map's force by its share into Lin's ``force_n``, in place, and derive torque x from the result.

    All arrays have n rows. NaN in ``poc_mm`` makes torque x NaN.
    """
    for start in range(0, len(counts), _CHUNK_ROWS):
        rows = slice(start, start + _CHUNK_ROWS)
        signals = tared(counts[rows], tare_q4[rows])
        part = (share(signals) / ALL)[:, None]
        force_n[rows] = part * alone(signals) + (1 - part) * force_n[rows]
    torque_nmm[:, 0] = derived_torque_x(poc_mm, force_n)


@cache
def compiled_coefficients() -> Any:
    """The coefficients as host/binding/population_float64.h wants them; they live as long as the process."""
    if [(kind, gate) for kind, gate, _ in blocks()] != _COMPILED:
        raise ValueError(
            f"{SHIPPED} has different blocks from host/binding/population_float64.c; retrain it with this version"
        )
    per_count = [c / SIGNAL_COUNTS if kind in (Kind.COMPRESSION, Kind.BULGE) else c for kind, _, c in blocks()]
    return ffi.new("double[]", np.concatenate(per_count).ravel().tolist())
