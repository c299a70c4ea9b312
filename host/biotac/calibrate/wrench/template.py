"""Joint template least squares: the shapes of a press, a bulge, two shears and a torsion, five numbers for each frame.

Around the point of contact each of the five has a shape over the electrodes. Their sizes come from one weighted 5x5
solve, and a dozen coefficients for each axis turn sizes into newtons (numerics.md 3.2). The model knows little of the
finger, so it shows how much of a calibrated map's accuracy is physics and how much is that finger's own. It runs on the
host alone and is never chosen. Finding the point of contact again without the part explained as shear, as numerics.md
proposes, is not done: on the emulated sensor it takes a fiftieth off Fy's error and adds a tenth to the torsion's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core import geometry as surface
from ...core.geometry import Floats
from ...core.map_columns import PRESSURE_COUNTS, Signals, conductance_change
from ...wire import map_gen as _map
from .moments import Rows, smoothed
from .run import Run

FOOTPRINT_MM = 2.5  # between that of a probe and of a flat plate
HOLE = 1.5  # radius around the contact that does not bulge, in footprints
REACH_MM = 7.0  # of shear and torsion
# A squeezed electrode is not linear in anything: the further it is from rest, the lower its weight.
SOFT = 0.5  # of log conductance
STIFFNESS = 1e-3  # ridge, as a share of the mean diagonal: keeps sizes small that no electrode near the contact senses
LEAST_CONDUCTANCE = 0.003  # of that at rest: 10 MOhm

LEAST_RIDGE = 1e-9  # for an axis with columns of zeros, because a size does not reach it

SHAPES = 5
PRESS, BULGE, ALONG, ACROSS, TURN = range(SHAPES)


@dataclass(frozen=True)
class Sizes:
    """Fits to n frames: ``point_mm``, ``normal``, ``to_tip``, ``to_side`` (n, 3) at the contact; ``size`` (n, 5)."""

    point_mm: Floats
    normal: Floats
    to_tip: Floats
    to_side: Floats
    size: Floats


def solve(signals: Signals) -> Sizes:
    """The five sizes of each frame, and the contact that they are about."""
    seen = np.log(np.maximum(conductance_change(signals.e, signals.tare) + 1.0, LEAST_CONDUCTANCE))
    weight = 1.0 / (1.0 + (seen / SOFT) ** 2)
    squeezed = np.maximum(-signals.e, 0.0) ** 2 + _map.FLOOR_COUNTS**2
    point = surface.project(squeezed @ surface.ELECTRODE_MM / squeezed.sum(axis=1, keepdims=True))
    normal = surface.normals_at(point)
    to_tip, to_side = surface.tangents_at(normal)
    shapes = _shapes(point, normal, to_tip, to_side)
    weighted = shapes * weight[:, :, None]
    gram = shapes.transpose(0, 2, 1) @ weighted
    gram += STIFFNESS * np.trace(gram, axis1=1, axis2=2)[:, None, None] / SHAPES * np.eye(SHAPES)
    size = np.linalg.solve(gram, (weighted * seen[:, :, None]).sum(axis=1)[:, :, None])[:, :, 0]
    return Sizes(point, normal, to_tip, to_side, size)


def _shapes(point: Floats, normal: Floats, to_tip: Floats, to_side: Floats) -> Floats:
    """Effect of each of the five on log conductance (n, 19, 5): a closed gap conducts less."""
    arm = surface.ELECTRODE_MM[None] - point[:, None, :]
    far = (arm**2).sum(axis=2)
    facing = np.maximum(normal @ surface.ELECTRODE_NORMAL.T, 0.0)
    reach = np.exp(-far / (2.0 * REACH_MM**2))
    moved = [to_tip @ surface.ELECTRODE_NORMAL.T, to_side @ surface.ELECTRODE_NORMAL.T]
    moved.append((np.cross(normal[:, None, :], arm) * surface.ELECTRODE_NORMAL).sum(axis=2))
    press = -np.exp(-far / (2.0 * FOOTPRINT_MM**2)) * facing
    bulge = 1.0 - np.exp(-far / (2.0 * (HOLE * FOOTPRINT_MM) ** 2))
    return np.stack([press, bulge, *[one * reach for one in moved]], axis=2)


def columns(signals: Signals) -> Floats:
    """Columns (n, 7, k) that the coefficients multiply, axis by axis: forces, c x F + torsion n, and the torsion.

    A press makes a force along the inward normal, shears make forces along the skin, and the torque of each comes from
    its lever. Every axis has its own coefficient for each, because no finger matches the model exactly.
    """
    its = solve(signals)
    size = its.size
    pressed = np.abs(size[:, PRESS])
    into = -its.normal
    scalars = [pressed, np.sqrt(pressed), size[:, BULGE], np.ones(len(size))]
    if signals.pdc is not None:
        scalars.append(signals.pdc / PRESSURE_COUNTS)
    forces = [into * scalar[:, None] for scalar in scalars]
    # the firmer the press, the stiffer the skin
    for direction, which in ((its.to_tip, ALONG), (its.to_side, ACROSS)):
        forces += [direction * size[:, which, None], direction * (size[:, which] * np.sqrt(pressed))[:, None]]
    torsions = [size[:, TURN], size[:, TURN] * np.sqrt(pressed)]
    result = np.zeros((len(size), 7, len(forces) + len(torsions)))
    for k, force in enumerate(forces):
        result[:, :3, k] = force
        result[:, 3:6, k] = np.cross(its.point_mm, force)
    for k, torsion in enumerate(torsions, start=len(forces)):
        result[:, 3:6, k] = its.normal * torsion[:, None]
        result[:, 6, k] = torsion
    return result


def fit(of: Floats, truth: Floats) -> Floats:
    """Least-squares coefficients (k,) of one axis, from its columns (n, k) and truth (n,)."""
    gram = of.T @ of
    return np.linalg.solve(gram + LEAST_RIDGE * np.trace(gram) * np.eye(len(gram)), of.T @ truth)


class Template:
    """The model on a run, for any lags and window; columns are computed once for each window."""

    def __init__(self, run: Run) -> None:
        self.run = run
        self.axes = run.truth.shape[1]
        self._columns: dict[int, Floats] = {}

    def held_out(
        self, window_rows: int, lag_rows: tuple[int, ...], trained: Rows, rows: Rows, shifts: Sequence[float]
    ) -> Floats:
        """Wrench (shifts, n, axes) for ``rows`` (n,) at each drift, by coefficients from the rows ``trained``."""
        if window_rows not in self._columns:
            signals = smoothed(self.run, window_rows)
            self._columns[window_rows] = np.array(
                [columns(signals.drifted(counts * self.run.drift))[:, : self.axes] for counts in shifts]
            )
        of = self._columns[window_rows]
        last = len(self.run.truth) - 1
        result = np.empty((len(shifts), len(rows), self.axes))
        for axis, lag in enumerate(lag_rows):
            late = of[:, :, axis]
            coefficients = fit(late[0, np.clip(trained + lag, 0, last)], self.run.truth[trained, axis])
            result[:, :, axis] = np.einsum("snk,k->sn", late[:, np.clip(rows + lag, 0, last)], coefficients)
        return result
