"""Rows of plates on real fingers, for a fit of the simulated finger: recorded values, and values to be fitted.

Two kinds are public. F1 and F2 have the force and not the place. Their forces are in the plate's axes, not the
finger's: where the point of contact says that a finger was rolled by 50 degrees, the recorded force still stands
upright on the plate, and a map of these forces gives a plate of known normal that rolls by 33 degrees a force that
rolls by -2. trial_15330 has the plate's normal and not the force; pressure gives its changes, not its size.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt

from biotac import RecordingError
from biotac.calibrate.wrench import Run
from biotac.core import geometry as surface
from biotac.kernels.unroll import roll_up, unroll
from biotac.sim import PLATE_MM, States

from ..experiments import laboratory

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

FRAMES, FRAMES_OF_PLATE = 300, 1000  # of each part: neighbours in time repeat each other
LEAST_N = 0.05
PLACE_LIMITS = (-15.5, -1.45), (7.5, 1.45)  # mm along the finger, rad of roll
ALONG_MM, ALONG_SIGMA_MM = -3.0, 4.0  # where a plate touches the cylinder, when nothing says it
ROLL_SIGMA = 0.07  # of the roll about the point of contact's, rad
NORMAL_SIGMA = 0.06  # of a tracked normal and of the core's as the skin's, rad
STRENGTH_SIGMA, SHEAR_SIGMA = 0.3, 0.2  # of the log of force for pressure; of unknown shear over force
SIDE_STRENGTH_SIGMA, SIDE = 1.5, 0.65  # at the very side pressure says little about force
CYLINDER = 0.1  # a normal with less of x is the cylinder's, and does not give the place along the finger
# Counts of pressure per newton with which a plate of known normal has F1's and F2's signals for a newton: on the pad,
# how many times as many at the tip, and at the very side, where the signals for a count are ten times the pad's.
# Navarro 2015 measured 62 to 111 on another pad, so that finger may as well be less than half as loud.
PER_N, PER_N_TIP, PER_N_SIDE, SIDES = 240.0, 3.3, 0.4, (0.6, 0.85)
# Points of contact are looked at in tenths of the normal, from so much pressure on, where there are so many rows.
TENTHS, LOOK_COUNTS, LOOK_ROWS, LOOK_FORCES_N, LOOK_ALONG_MM = (
    np.arange(0.0, 0.7, 0.1),
    150.0,
    20,
    (2.0, 4.0, 6.0),
    -4.0,
)
QUIET_COUNTS, QUIET_ROWS, REST_PERCENTILE = 15.0, 60, 5.0
PRESSED_COUNTS = 60.0


def felt_place(signal: Floats) -> Floats:
    """The places (n, 2) of the points of contact by compression; the middle of the pad where nothing is compressed."""
    point = surface.point_of_contact(signal, 1.0, compressed=True)
    point[np.isnan(point).any(axis=1)] = [ALONG_MM, 0.0, -surface.RADIUS_MM]
    return np.clip(place_of(point), *PLACE_LIMITS)


def place_of(points_mm: Floats) -> Floats:
    """Places (n, 2) of points (n, 3) of the surface: mm along it from the cap's edge, and rad of roll."""
    across, along = unroll(points_mm)
    return np.column_stack([along, across / surface.RADIUS_MM])


def plate_states(place: Floats, force_n: Floats) -> States:
    """A plate at ``place`` (n, 2) with ``force_n`` (n, 3) in its own axes: along, across, and into the finger."""
    contact = roll_up(surface.RADIUS_MM * place[:, 1], place[:, 0])
    along, across = surface.tangents_at(surface.normals_at(contact))
    still = np.zeros(len(contact))
    shear = force_n[:, :1] * along + force_n[:, 1:2] * across
    return States(contact, np.maximum(force_n[:, 2], LEAST_N), shear, still, np.full(len(still), PLATE_MM), still)


def pressing(place: Floats, force_n: Floats) -> States:
    """A plate that presses straight at ``place`` (n, 2), with ``force_n`` (n,)."""
    none = np.zeros(len(place))
    return plate_states(place, np.column_stack([none, none, force_n]))


def place_under(normal: float, *, sideways: bool) -> list[float]:
    """The place where a plate's unit normal has so much to a side of the pad, or to the tip."""
    angle = float(np.arcsin(normal))
    return [LOOK_ALONG_MM, angle] if sideways else [surface.RADIUS_MM * angle, 0.0]


@dataclass(frozen=True)
class Unknown:
    """A fit's unknowns of each row, (n, k) each: where they begin, their priors, and their limits."""

    first: Floats
    mean: Floats
    sigma: Floats
    low: Floats
    high: Floats


@dataclass(frozen=True)
class KnownForce:
    """``counts`` (n, 19) under ``force_n`` (n, 3) in the plate's axes; ``time``: -0.5 to 0.5; ``drift``: the tare's."""

    counts: Floats
    force_n: Floats
    time: Floats
    tare: Floats
    drift: Floats

    @cached_property
    def unknown(self) -> Unknown:
        """Place and roll of each row, about the point of contact's."""
        first = felt_place(self.counts - self.tare)
        mean = np.column_stack([np.full(len(first), ALONG_MM), first[:, 1]])
        sigma = np.tile([ALONG_SIGMA_MM, ROLL_SIGMA], (len(first), 1))
        low, high = (np.tile(limit, (len(first), 1)) for limit in PLACE_LIMITS)
        return Unknown(first, mean, sigma, low, high)

    def states(self, row: Floats) -> States:
        """The contacts, when the rows' unknown values are ``row`` (n, 2)."""
        return plate_states(row, self.force_n)


@dataclass(frozen=True)
class KnownNormal:
    """``counts`` (n, 19) above ``tare`` (n, 19) under a plate of unit ``normal`` (n, 3); ``pressure`` (n,) in counts.

    ``press`` (n,) numbers the presses, from 1.
    """

    counts: Floats
    tare: Floats
    pressure: Floats
    normal: Floats
    press: npt.NDArray[np.int64]

    @property
    def fitted(self) -> npt.NDArray[np.intp]:
        """Rows that a fit may use: some of every second press."""
        rows = np.flatnonzero(self.press % 2 == 1)
        chosen: npt.NDArray[np.intp] = np.sort(
            np.random.default_rng(0).choice(rows, min(FRAMES_OF_PLATE, len(rows)), False)
        )
        return chosen

    @property
    def judging(self) -> npt.NDArray[np.intp]:
        """Rows that no fit has seen."""
        return np.flatnonzero(self.press % 2 == 0)

    @cached_property
    def force_n(self) -> Floats:
        """This pressure in newtons if the finger is as loud as F1 and F2, (n,): nobody has measured it."""
        tip, side = np.maximum(self.normal[:, 0], 0.0), np.interp(np.abs(self.normal[:, 1]), SIDES, (0.0, 1.0))
        force_n: Floats = self.pressure / (PER_N * PER_N_TIP**tip * PER_N_SIDE**side)
        return force_n

    @cached_property
    def place(self) -> Floats:
        """Where the plate touched (n, 2): on the cylinder the place along the finger is the point of contact's."""
        place = place_of(surface.RADIUS_MM * self.normal)
        felt = np.minimum(felt_place(self.signal)[:, 0], 0.0)
        place[:, 0] = np.where(self.normal[:, 0] < CYLINDER, felt, place[:, 0])
        return place

    @property
    def time(self) -> Floats:
        """The tare follows the rest: no drift is left."""
        return np.zeros(len(self.counts))

    @property
    def drift(self) -> Floats:
        """None."""
        return np.zeros(self.counts.shape[1])

    @property
    def signal(self) -> Floats:
        """Counts above the tare (n, 19)."""
        return self.counts - self.tare

    def of(self, rows: npt.NDArray[np.intp] | Bools) -> KnownNormal:
        """Some of the rows."""
        return KnownNormal(self.counts[rows], self.tare[rows], self.pressure[rows], self.normal[rows], self.press[rows])

    @cached_property
    def unknown(self) -> Unknown:
        """Place, roll, log of the force, and shear along and across as shares of it."""
        n, cylinder = len(self.counts), self.normal[:, 0] < CYLINDER
        place = self.place
        strength, none = np.log(self.force_n), np.zeros(n)
        first = np.column_stack([place, strength, none, none])
        mean = np.column_stack([np.where(cylinder, ALONG_MM, place[:, 0]), place[:, 1], strength, none, none])
        along = np.where(cylinder, ALONG_SIGMA_MM, surface.RADIUS_MM * NORMAL_SIGMA)
        strong = np.where(np.abs(self.normal[:, 1]) > SIDE, SIDE_STRENGTH_SIGMA, STRENGTH_SIGMA)
        rest = np.full((n, 2), SHEAR_SIGMA)
        sigma = np.column_stack([along, np.full(n, NORMAL_SIGMA), strong, rest])
        (x_low, roll_low), (x_high, roll_high) = PLACE_LIMITS
        far, top = np.full(n, 10.0), np.where(cylinder, surface.RADIUS_MM * CYLINDER, x_high)
        low = np.column_stack([np.full(n, x_low), np.full(n, roll_low), strength - 4.0, -far, -far])
        high = np.column_stack([top, np.full(n, roll_high), strength + 4.0, far, far])
        return Unknown(np.clip(first, low + 1e-6, high - 1e-6), mean, sigma, low, high)

    def states(self, row: Floats) -> States:
        """The contacts, when the rows' unknown values are ``row`` (n, 5)."""
        strength = np.exp(row[:, 2])
        return plate_states(row[:, :2], np.column_stack([row[:, 3:] * strength[:, None], strength]))


Part = KnownForce | KnownNormal


def halves(run: Run, seed: int = 0) -> Iterator[KnownForce]:
    """Both halves of an aligned run, FRAMES of each, drawn at random."""
    rng, n = np.random.default_rng(seed), len(run.counts)
    for first, last in ((0, n // 2), (n // 2, n)):
        rows = np.sort(rng.choice(np.arange(first, last), min(FRAMES, last - first), replace=False))
        yield KnownForce(run.counts[rows], run.truth[rows], rows / n - 0.5, run.tare, run.drift)


def load_normals(path: Path) -> KnownNormal:
    """The rows in which a plate of known normal pressed, of an .npz with E, PDC and z_dir.

    The tare is the median of the last quiet rows, with a pressure within QUIET_COUNTS of rest. Raises RecordingError
    naming the field that is missing, or when nothing is pressed.
    """
    trial = laboratory.load(path, needs=("PDC", "z_dir"))
    counts, pdc = trial.counts.astype(np.float64), trial.pdc.astype(np.float64)
    rest = np.percentile(pdc, REST_PERCENTILE)
    quiet = np.flatnonzero(pdc - rest < QUIET_COUNTS)
    before = np.searchsorted(quiet, np.arange(len(pdc)), side="right")
    tare, zero = np.empty_like(counts), np.empty_like(pdc)
    for k in np.unique(before):
        last = quiet[max(k - QUIET_ROWS, 0) : k]
        known = len(last) > 0
        tare[before == k] = np.median(counts[last], axis=0) if known else counts[:20].mean(axis=0)
        zero[before == k] = np.median(pdc[last]) if known else rest
    pressed = pdc - zero > PRESSED_COUNTS
    if not pressed.any():
        raise RecordingError(
            f"{path}: PDC is never {PRESSED_COUNTS:g} counts above rest: expected presses; check that PDC is in counts"
        )
    press = np.cumsum(np.diff(np.concatenate([[0], pressed.astype(int)])) == 1)
    every = KnownNormal(counts, tare, pdc - zero, trial.plate_normal, press)
    return every.of(pressed)
