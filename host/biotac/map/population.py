"""The force of an uncalibrated finger, in float64, by the population map that comes with the package.

The board has the same map in 16 bits, firmware/core/map/population.c, made by board_map(). This module reads the
coefficients as trained, and makes the columns as training does; boards are checked against it. biotac.compute runs the
same formulas in host/binding/compute.c. See SPEC.md, Population map.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

import numpy as np
import numpy.typing as npt

from ..kernels.compiled import FORCE_GAINS
from ..kernels.geometry import ELECTRODE_MM, Floats
from ..wire import messages_gen as wire
from ..wire.fields import MN_PER_N
from ..wire.frames import FORCE_LSB_PER_N
from ..wire.map_gen import FLOOR_COUNTS, Gate, Kind
from ..wire.native import ffi, lib
from ..wire.sensor_gen import CORE_RADIUS_UM
from .board_map import BoardMap
from .columns import GATED, REACH_MM, SIGNAL_COUNTS, split, tared
from .fitted import quantise
from .float64 import Unrounded
from .margin import UNKNOWN, Margin

SHIPPED = "population.json"
Integers = npt.NDArray[np.int64]

ALL = 256  # the share 1
_NOISE_Q4 = 8 * 16
_KNEE_Q4 = 256 * 16
_TO_BITS = 13
_UNIT_BITS = 12
_LEAST_Q4 = 64 * 16
_LIGHT_Q4 = 1500 * 16
_FAR_8, _OUTSIDE = 11, 2
_GAIN_LEAST = 102


def unfelt_n(parts_n: Floats, poc_mm: Floats) -> Floats:
    """Added to the half widths (n, 2) in N of normal and shear ``parts_n`` (n, 2) at ``poc_mm`` (n, 3).

    The map feels too little of pulls and light touches, and too much of presses at the tip. A board adds to
    it where pressure allows more.
    """
    pull_n = 5 / 8 * np.maximum(parts_n[:, 1] - parts_n[:, 0] / 5, 0.0)
    x_mm = np.maximum(poc_mm[:, 0], 0.0)
    ahead_n = pull_n * x_mm / 4.096
    tip_n = 51 / 256 * parts_n[:, 0] * np.minimum(x_mm / 2.048, 1.0)
    light_n = np.maximum(1.5 - parts_n.sum(axis=1), 0.0) / 2
    return np.column_stack([ahead_n + tip_n + light_n, ahead_n + pull_n])


def in_force(settings: Mapping[wire.Setting, int]) -> bool:
    """Whether the force of a finger with these settings and no wrench map comes from the population map."""
    model = settings.get(wire.Setting.FORCE_MODEL, wire.SETTINGS[wire.Setting.FORCE_MODEL].default)
    own = any(settings.get(gain, wire.SETTINGS[gain].default) != wire.SETTINGS[gain].default for gain in FORCE_GAINS)
    return model == wire.ForceModel.POPULATION and not own


def shipped() -> str:
    """The package's population map as JSON text (biotac.calibrate.population)."""
    return resources.files(__package__).joinpath(SHIPPED).read_text(encoding="utf-8")


@cache
def blocks() -> dict[tuple[Kind, Gate], Floats]:
    """The coefficients (columns, 3) in N of each block."""
    facts = json.loads(shipped())
    named = [(Kind[kind], Gate[gate]) for kind, gate in facts["blocks"]]
    coefficients = np.array(facts["coefficients_n_and_variance"], dtype=np.float64)[:, :3]
    return split(named, coefficients)


@cache
def margin() -> Margin:
    """The margin of the package's map on held-out fingers."""
    return Margin(*map(tuple, json.loads(shipped())["margin"]))


def unrounded(newtons: Mapping[tuple[Kind, Gate], Floats]) -> Unrounded:
    """Such blocks in the board's unit of force."""
    return {block: values * FORCE_LSB_PER_N for block, values in newtons.items()}


def board_map(newtons: Mapping[tuple[Kind, Gate], Floats], margin: Margin = UNKNOWN) -> BoardMap:
    """Such blocks as a board's map. Raises InputError when they do not fit the board's formats."""
    return quantise(unrounded(newtons), margin=margin)


@dataclass(frozen=True)
class Likeness:
    """How like the training n frames are; defined in integers, so that all boards agree (SPEC.md, Population map).

    ``share`` (n,) of the force comes from the map; ``gain`` (n,) of all of it, in 1/256; ``outside`` (n,);
    ``otherwise_n`` (n, 3), the other force before the gain; ``strength_100un`` (n,) by the sum of all signals.
    """

    share: Integers
    gain: Integers
    outside: npt.NDArray[np.bool_]
    otherwise_n: Floats
    strength_100un: Integers

    @property
    def guess_n(self) -> Floats:
        """A board's addition to the half widths (n, 2) of normal and shear where it is not sure, in N."""
        guess = ffi.new("uint32_t[2]")
        found = np.empty((len(self.share), 2))
        for k, row in enumerate(
            zip(self.share.tolist(), self.outside.tolist(), self.strength_100un.tolist(), strict=True)
        ):
            lib.bt_population_guess(*row, guess)
            found[k] = guess[0], guess[1]
        return found / MN_PER_N

    def half_n(self, parts_n: Floats) -> Floats:
        """The map's margin in the half widths (n, 2), whatever the parts."""
        return self.guess_n

    @property
    def flags(self) -> Integers:
        """OUTSIDE (n,) where it is."""
        return np.where(self.outside, wire.FrameFlags.OUTSIDE, 0)

    @property
    def map_part(self) -> Integers:
        """The factor (n,) of the map's force in the published force, in 1/256; the other's is gain less this."""
        return self.share * self.gain // ALL

    def mixed(self, force_n: Floats) -> Floats:
        """The map's force (n, 3) in N, mixed with the other, times the gain."""
        part = self.map_part
        return (part / ALL)[:, None] * force_n + ((self.gain - part) / ALL)[:, None] * self.otherwise_n

    def bound(self, off_n: Floats) -> Floats:
        """Of mixed(), where the map is off by at most ``off_n`` (n, 3); the other force is exact."""
        part = (self.map_part / ALL)[:, None]
        # The force from normals alone is often off by just a half, give or take float64's own rounding.
        half = 0.5 + 1e-6
        return np.where(part > 0, part * off_n, 0.0) + half / FORCE_LSB_PER_N


def likeness(e: Floats, force_100un: Integers) -> Likeness:
    """How like the training the signals ``e`` (n, 19) in counts are, with the map's ``force_100un`` (n, 3)."""
    q4 = _bounded_q4(e)
    total = np.abs(q4).sum(axis=1)
    firm = total * 25 >> 5
    along = _along_normals(q4, total, firm)
    most = total - _LIGHT_Q4 >> 6
    off = np.where(most > 0, np.abs(force_100un - along).max(axis=1), 0)  # else boards do not evaluate the map
    share = (_FAR_8 * firm - 8 * off) * (ALL // 4) // np.maximum(firm, 1)
    share = np.clip(np.minimum(share, most), 0, ALL)
    pressed = -np.minimum(q4, 0).sum(axis=1)
    outside = (total < _LEAST_Q4) | (off > _OUTSIDE * firm) | ((share < ALL) & (8 * pressed < total))
    gain = _gain(total)
    return Likeness(share, gain, outside, along / FORCE_LSB_PER_N, firm * gain // ALL)


def likeness_of(
    counts: npt.NDArray[np.uint16], tare_q4: npt.NDArray[np.uint16], used: BoardMap | None = None
) -> Likeness:
    """likeness() of FRAMEs' integers (n, 19), by the package's map or one like it."""
    return likeness(tared(counts, tare_q4).e, board_force_100un(counts, tare_q4, used))


def light_gain(e: Floats) -> Floats:
    """The gain (n,), 0.4 to 1, of the published force of signals ``e`` (n, 19) in counts: below 1 in a light touch."""
    return _gain(np.abs(_bounded_q4(e)).sum(axis=1)) / ALL


def _bounded_q4(e: Floats) -> Integers:
    e_q4 = np.rint(16 * e).astype(np.int64)
    size = np.maximum(np.abs(e_q4) - _NOISE_Q4, 0)
    bounded: Integers = np.sign(e_q4) * np.where(size > _KNEE_Q4, _KNEE_Q4 + (size - _KNEE_Q4 >> 2), size)
    return bounded


def _gain(total_q4: Integers) -> Integers:
    gain: Integers = np.clip(total_q4 * 13 >> 11, _GAIN_LEAST, ALL)
    return gain


def board_force_100un(
    counts: npt.NDArray[np.uint16], tare_q4: npt.NDArray[np.uint16], used: BoardMap | None = None
) -> Integers:
    """The force (n, 3) of the package's map, or of one like it, as boards compute it, before it is mixed."""
    pressure = np.zeros(len(counts), np.int32)
    return (used or on_board()).results(counts, tare_q4, pressure)[0].astype(np.int64)


@cache
def on_board() -> BoardMap:
    """The package's map in a board's 16 bits."""
    return board_map(blocks(), margin())


def _along_normals(x: Integers, total: Integers, strength_100un: Integers) -> Integers:
    place_um = np.rint(1000 * ELECTRODE_MM).astype(np.int64)
    place_um[:, 0] = np.maximum(place_um[:, 0], 0)  # on the cylinder a normal has no x
    to = np.minimum(x, 0) @ place_um
    to[:, 2] += (CORE_RADIUS_UM // 32) * total
    down = (np.ceil(np.log2(np.abs(to).max(axis=1) + 1.0)).astype(np.int64) - _TO_BITS)[:, None]
    size = (np.abs(to) << np.maximum(-down, 0) >> np.maximum(down, 0)) * [3, 3, 5]  # the tilt is 0.6
    length = np.floor(np.sqrt((size**2).sum(axis=1).astype(np.float64))).astype(np.int64)
    unit = size * ((1 << 31) // np.maximum(length, 1))[:, None] >> 31 - _UNIT_BITS
    force: Integers = np.sign(to) * (unit * strength_100un[:, None] >> _UNIT_BITS)
    return force


@cache
def compiled_coefficients() -> Any:
    """The coefficients as host/binding/compute.h wants them; they live as long as the process."""
    if list(blocks()) != list(GATED):
        raise ValueError(f"{SHIPPED} has different blocks from host/binding/compute.c; retrain it with this version")
    by_gate = np.concatenate(list(blocks().values())).reshape(3, -1, 3) / SIGNAL_COUNTS
    centroid = np.column_stack([np.ones(len(ELECTRODE_MM)), ELECTRODE_MM[:, :2] / REACH_MM])
    rows = np.zeros((2 * len(centroid) + 1, 12))
    rows[:-1, :9] = by_gate.transpose(1, 0, 2).reshape(-1, 9)
    rows[: len(centroid), 9:], rows[-1, 9:] = -centroid, FLOOR_COUNTS * centroid.sum(axis=0)
    return ffi.new("bt_population_column[]", rows.tolist())
