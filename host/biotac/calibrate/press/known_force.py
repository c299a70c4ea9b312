"""Presses of known force, guided on a board or from a recording: the population map fitted to them, and the error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...core.compute import compute
from ...errors import InputError
from ...hand.hand import Hand
from ...kernels.geometry import Floats, normals_at
from ...recording.reader import Recording
from ...wire import messages_gen as wire
from ..population import Population, columns
from ..wrench.figures import angles_deg, rmse
from .detector import Press, Procedure, find
from .few_shot import SCALE, Scale, Way, fit, scale_of
from .force_source import ForceSource, rows_of
from .guide import Prompt, guide

LEAST_PRESSES = 3
FAR_SIGMAS = 3.0
UNIT_SHARE = (0.6, 1.6)  # of the readings over the map's force: beyond, they are likelier in another unit
WORSE = 1.1  # held out, z may be off by this much more: chance with few presses
EQUAL, UNEQUAL = 0.01, 0.3  # ranges, as shares of the mean: of readings that are the same, of presses that are not
STRAIGHT_DOWN = (0.0, 0.0, 1.0)
ASKED_N = (2.0, 5.0, 3.0, 6.0, 4.0)  # on a scale: light and firm in turn; starts again after the last
CURE = "tare, and load the pad flat, firmly and steadily"
SIDE = 0.3  # component of a plate's normal, on each side


@dataclass(frozen=True)
class Held:
    """Frames of k presses: ``counts`` (n, 19), ``tare`` (19,), and the ``press`` (n,) of each frame, 0 to k - 1.

    ``force_n`` (k, 3) is the force on the finger.
    """

    counts: Floats
    tare: Floats
    press: Any
    force_n: Floats

    @cached_property
    def columns(self) -> Floats:
        """The map's columns (k, 114), a mean over each press."""
        every = columns(self.counts - self.tare, self.tare)
        return np.array([every[self.press == k].mean(axis=0) for k in range(len(self.force_n))])


@dataclass(frozen=True)
class PressedMap:
    """The finger's ``own`` map, fitted to all presses, and RMS errors (3,) in N over the presses.

    ``scale`` is the correction, None for a plate. ``shown_n`` and ``felt_n`` (k,) are z as given and as read by the
    map. ``held_out_n`` is with each press predicted by a map fitted to the others, ``before_n`` that of the map as it
    was; ``before_deg`` and ``held_out_deg`` are the median errors of the direction.
    """

    own: Population
    way: Way
    scale: Scale | None
    shown_n: Floats
    felt_n: Floats
    before_n: Floats
    held_out_n: Floats
    before_deg: float
    held_out_deg: float

    def to_state_n(self, sigma_n: Floats) -> Floats:
        """RMS error (3,) to state: held out; of x and y, which straight presses do not test, ``sigma_n`` if more."""
        return np.array([*np.maximum(self.held_out_n, sigma_n)[:2], self.held_out_n[2]])

    def why_not(self, sigma_n: Floats) -> str:
        """Why the own map should not be used; empty if it should.

        It should if the forces are believable, if it is better than the map as it was, and if the finger is like those
        that the map knows: each axis's held-out error is below FAR_SIGMAS times the map's one sigma ``sigma_n`` (3,).
        """
        return self._why_not_forces() or self._why_not_errors(sigma_n)

    def _why_not_forces(self) -> str:
        if self.scale is None:
            return ""
        share, (low, high) = float(np.median(self.shown_n / self.felt_n)), UNIT_SHARE
        if not low <= share <= high:
            return (
                f"{self.way.name} say {share:.2f} times what the map felt, expected {low:g} to {high:g}; check "
                f"{self.way.size}"
            )
        even, felt = (float(np.ptp(z) / z.mean()) for z in (self.shown_n, self.felt_n))
        if self.way is SCALE and even < EQUAL and felt > UNEQUAL:
            return (
                f"every reading is {self.shown_n.mean():.3g} N, but the map felt {self.felt_n.min():.2g} to "
                f"{self.felt_n.max():.2g} N, expected readings that follow; is the scale's hold on?"
            )
        return ""

    def _why_not_errors(self, sigma_n: Floats) -> str:
        before, held_out = np.linalg.norm(self.before_n), np.linalg.norm(self.held_out_n)
        if not held_out < before:
            return (
                f"held out, it is off by {held_out:.2f} N, no better than the {before:.2f} N of the population map; "
                f"{CURE}"
            )
        if self.scale is not None and self.held_out_n[2] > max(WORSE * self.before_n[2], sigma_n[2]):
            return (
                f"held out, z is off by {self.held_out_n[2]:.2f} N, more than the {self.before_n[2]:.2f} N of the "
                f"population map; {CURE}"
            )
        far = 0.0 if self.way.spread is None else FAR_SIGMAS * self.way.spread[2, 2]
        if self.scale is not None and abs(self.scale.gain - 1.0) > far:
            return (
                f"the gain of z is {self.scale.gain:.2f}, expected {1 - far:.2f} to {1 + far:.2f}, as fingers have it; "
                f"check {self.way.size}"
            )
        for axis, error_n, limit_n in zip("xyz", self.held_out_n, FAR_SIGMAS * sigma_n, strict=True):
            if not error_n < limit_n:
                return (
                    f"held out, {axis} is off by {error_n:.2f} N, not below {FAR_SIGMAS:g} sigma ({limit_n:.2f} N): "
                    f"the finger is unlike those of the population map; {CURE}"
                )
        return ""


def found(population: Population, held: Held, way: Way) -> PressedMap:
    """The finger's own map, and the errors. Raises InputError for presses that cannot be used."""
    columns, force_n = held.columns, held.force_n
    own = fit(population, columns, force_n, way)
    every = np.arange(len(force_n))
    out = [columns[k] @ fit(population, columns[every != k], force_n[every != k], way).coefficients for k in every]
    before, held_out = columns @ population.coefficients, np.array(out)
    deg = [float(np.median(angles_deg(felt_n, force_n))) for felt_n in (before, held_out)]
    scale = None if way.spread is None else scale_of(before, force_n, way)
    return PressedMap(
        own, way, scale, force_n[:, 2], before[:, 2], rmse(before, force_n), rmse(held_out, force_n), *deg
    )


def of_plate(held: Held, population: Population) -> Held:
    """Presses of a flat plate: against the skin's normal at the point of contact, with the population's strength.

    Raises InputError unless both sides were pressed, for nothing corrects an unpressed side.
    """
    mean = np.array([held.counts[held.press == k].mean(axis=0) for k in range(len(held.force_n))])
    inward = -normals_at(compute(np.rint(mean).astype(np.uint16), held.tare)["poc_mm"])
    if not np.isfinite(inward).all():
        raise InputError("a press has no point of contact: expected one in each; tare the finger, and press harder")
    if not (inward[:, 1].max() > SIDE and inward[:, 1].min() < -SIDE):
        raise InputError(
            f"the plate's normal was {inward[:, 1].min():.2f} to {inward[:, 1].max():.2f} across: expected beyond "
            f"-{SIDE} and {SIDE}; roll the finger further to both sides"
        )
    strength_n = np.linalg.norm(population.published(mean, held.tare), axis=1, keepdims=True)
    return replace(held, force_n=strength_n * inward)


def guided(
    hand: Hand,
    finger: int,
    forces_n: Sequence[float],
    prompt: Prompt,
    *,
    reference: ForceSource | None = None,
    toward: Sequence[Sequence[float]] | None = None,
) -> Held:
    """Presses on a board, one for each of ``forces_n`` (k,): ``prompt`` names the next step, and gives each force.

    A ``reference`` gives the force instead. ``toward`` (k, 3) are directions, straight down if not given. Raises
    InputError for too few presses, for one that does not come, or for one without a complete frame.
    """
    _check_enough(len(forces_n))
    procedure = Procedure([finger], forces_n, needs_force=reference is not None)
    presses = guide(hand, procedure, reference, prompt)[finger]
    hand.stop()
    return _held(presses, toward)


def recorded(
    recording: Recording,
    finger: int,
    forces_n: Sequence[float],
    toward: Sequence[Sequence[float]] | None = None,
    *,
    shown: bool = True,
) -> Held:
    """Presses in a recording, one for each of ``forces_n`` (k,). Raises InputError when it has fewer.

    With more it raises too, except where the forces are only those asked for, and nothing has ``shown`` them.
    """
    _check_enough(len(forces_n))
    own = recording.wire["finger"] == finger
    rows = rows_of(recording.wire[own], recording.frames["t_us"][own])
    return _held(find(finger, rows, len(forces_n), shown_n=forces_n if shown else ())[1], toward)


def _check_enough(presses: int) -> None:
    if presses < LEAST_PRESSES:
        raise InputError(f"{presses} presses of known force: expected {LEAST_PRESSES} or more; five work better")


def _held(presses: Sequence[Press], toward: Sequence[Sequence[float]] | None) -> Held:
    above, numbers, tares = [], [], []
    for k, press in enumerate(presses):
        rows = press.rows
        whole = (rows["counts"] != wire.INVALID_COUNT).all(axis=1) & np.isfinite(rows["tare"]).all(axis=1)
        if not whole.any():
            raise InputError(f"press {k + 1}: no frame with all electrodes and a tare: expected one; check the sensor")
        # above each press's own tare: the board takes a new one between presses
        above.append(rows["counts"][whole] - rows["tare"][whole])
        tares.append(rows["tare"][whole])
        numbers.append(np.full(int(whole.sum()), k))
    tare = tares[0].mean(axis=0)
    directions = np.array([STRAIGHT_DOWN] * len(presses) if toward is None else toward)
    sizes_n = np.array([press.force_n for press in presses])
    return Held(np.concatenate(above) + tare, tare, np.concatenate(numbers), sizes_n[:, None] * directions)
