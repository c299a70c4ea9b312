"""The models, all linear in their coefficients, solved from sums alone.

Ridge shrinks towards prior knowledge, not towards zero: Lin's geometry, and in other members of the pool
the map of other fingers. A coefficient that the run does not determine keeps that prior value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...core import geometry as surface
from ...kernels.geometry import Floats
from ...map.columns import ELECTRODES, GATED, PRESSURES, SIGNAL_COUNTS, Block, index
from ...wire.map_gen import Gate, Kind
from .moments import WeightedSums

# Ridge per row, in units of each column's own variance; every model is fitted with both.
LAMBDAS = (3e-6, 3e-4)
# The same towards the map of other fingers, which deserves more trust. For F1 and F2, each with the other's map, a
# third of the recording is then as good as half of it without; with the whole recording it adds a fiftieth to F1's
# error and takes a fifteenth off F2's.
OTHERS_LAMBDAS = (1e-3, 1e-1)
# A column that is constant in training has no variance to scale by: without a floor its coefficient is unconstrained,
# and a test row in which it varies can give anything (a model with a hinge once had R2 -34).
COLUMN_FLOOR = 0.01
# How much of each member's own squared error is added as chance: 0 trusts the inner folds and follows their noise. It
# is in proportion to the error: a member that is far off in some folds (extrapolation) varies most between folds.
CHANCE = 0.5


@dataclass(frozen=True)
class Model:
    """A ridge regression on blocks of columns, in the order of BLOCKS; PRESSURE only where it was recorded."""

    name: str
    blocks: tuple[Block, ...]
    text: str


_CONDUCTANCES = ((Kind.CONDUCTANCE, Gate.ONE), (Kind.CONDUCTANCE_PAIRS, Gate.ONE))
_SIGNALS = ((Kind.SIGNAL, Gate.ONE), (Kind.SIGNAL_PAIRS, Gate.ONE))

AFFINE = Model("affine", _SIGNALS[:1], "every electrode to every axis")
QUADRATIC = Model("quadratic", (*_SIGNALS, *PRESSURES), "all products of two electrodes, PDC where recorded")
CONDUCTANCE = Model(
    "conductance-quadratic", (*_CONDUCTANCES, *PRESSURES), "all products of two conductances, PDC where recorded"
)
JOINED = Model("joined", (*_CONDUCTANCES, *GATED, *PRESSURES), "the same, plus gains by sign that follow the contact")
MODELS = (AFFINE, QUADRATIC, CONDUCTANCE, JOINED)

LIN, LIN_OFFSET = "lin-scales", "lin-scales-offset"
# The best model and lambda change from axis to axis and from block to block: choosing one is worse than a weighted mean
# of all (F2, x: 0.43 N instead of 0.35 N).
POOL = (QUADRATIC, CONDUCTANCE, JOINED)
POOLED = "pooled"
TEXTS = {
    LIN: "Lin's sums, one scale per axis",
    LIN_OFFSET: "the same, with an offset per axis",
    **{model.name: model.text for model in MODELS},
    POOLED: "weighted mean of " + ", ".join(model.name for model in POOL),
}


def lin_directions(axes: int) -> Floats:
    """Lin's Eq 3 and 4: each electrode's contribution per count (19, axes), in [1] for force and in mm for torque.

    The seventh axis is Eq 4 about the middle of the pad and its outward normal, -z: torsion if the contact is there.
    """
    arms = np.cross(surface.ELECTRODE_MM, surface.ELECTRODE_NORMAL)
    middle = surface.ELECTRODE_MM.mean(axis=0)
    torsion = -np.cross(surface.ELECTRODE_MM - middle, surface.ELECTRODE_NORMAL)[:, 2:]
    return np.concatenate([surface.ELECTRODE_NORMAL, arms, torsion], axis=1)[:, :axes]


def lin(sums: WeightedSums, *, offset: bool = True) -> Floats:
    """Lin's scales, least squares per axis, as coefficients (p + 1, axes) of all columns."""
    axes = sums.cross.shape[1]
    own = index(AFFINE.blocks, len(sums.gram) - 1)
    small = sums.part(own)
    result = np.zeros(sums.cross.shape)
    for axis, direction in enumerate(lin_directions(axes).T):
        basis = np.zeros((ELECTRODES + 1, 1 + offset))
        basis[:-1, 0] = direction * SIGNAL_COUNTS
        if offset:
            basis[-1, 1] = 1.0
        gram = basis.T @ small.gram @ basis
        # M_x is the difference of two electrodes: if nothing reaches them, it would be 0 / 0
        gram[0, 0] += 1e-9 * max(float(gram.max()), 1.0)
        result[np.append(own, -1), axis] = basis @ np.linalg.solve(gram, basis.T @ small.cross[:, axis])
    return result


class Ridge:
    """Ridge regression on the columns of ``gram`` (q, q), shrunk towards zero except for the offset, which is last."""

    def __init__(self, gram: Floats) -> None:
        # columns are centred, as the offset is free, and scaled to variance 1
        self._rows = gram[-1, -1]
        self._mean = gram[-1, :-1] / self._rows
        centred = gram[:-1, :-1] / self._rows
        centred -= self._mean[:, None] * self._mean
        variance = np.diag(centred)
        self._scale = 1.0 / np.sqrt(np.maximum(variance, COLUMN_FLOOR * np.median(variance)))
        centred *= self._scale[:, None]
        centred *= self._scale
        self._gram, self._diagonal = centred, np.diag(centred).copy()

    def solve(self, cross: Floats, lam: float) -> Floats:
        """Coefficients (q, axes) for the products ``cross`` (q, axes) with the truth."""
        offset = cross[-1] / self._rows
        centred = cross[:-1] / self._rows - self._mean[:, None] * offset
        np.fill_diagonal(self._gram, self._diagonal + lam)
        found = np.linalg.solve(self._gram, centred * self._scale[:, None]) * self._scale[:, None]
        return np.concatenate([found, (offset - self._mean @ found)[None]])


def solve(sums: WeightedSums, lam: float) -> Floats:
    """Ridge coefficients (q, axes) of all columns with ``lam``."""
    return Ridge(sums.gram).solve(sums.cross, lam)


def pulled(sums: WeightedSums, chosen: Sequence[Model], others: Floats | None = None) -> list[Floats]:
    """For each model, coefficients (2, p + 1, axes) of all columns with each of LAMBDAS, pulled to Lin's scales.

    Given ``others`` (q + 1, 3), which have no columns of PDC, those of POOL come again with OTHERS_LAMBDAS, the force
    pulled to these.
    """
    known = lin(sums)
    targets = [(known, LAMBDAS, chosen)]
    if others is not None:
        known = known.copy()
        known[:, : others.shape[1]] = 0.0
        known[: len(others) - 1, : others.shape[1]] = others[:-1]
        known[-1, : others.shape[1]] = others[-1]
        targets.append((known, OTHERS_LAMBDAS, [model for model in chosen if model in POOL]))
    ridges = {}
    for model in chosen:
        own = np.append(index(model.blocks, len(known) - 1), len(known) - 1)
        ridges[model.name] = own, Ridge(sums.gram[np.ix_(own, own)])
    result = []
    for known, lambdas, models in targets:
        residual = sums.cross - sums.gram @ known
        for model in models:
            own, ridge = ridges[model.name]
            found = np.repeat(known[None], len(lambdas), axis=0)
            for coefficients, lam in zip(found, lambdas, strict=True):
                coefficients[own] += ridge.solve(residual[own], lam)
            result.append(found)
    return result


def weights(error: Floats) -> Floats:
    """Weights (m,) of members, not below 0 and with sum 1, for the least squared error of their mean; see CHANCE.

    ``error`` (m, m) is the mean product of each two members' errors.
    """
    size = len(error)
    error = error + CHANCE * np.diag(np.diag(error))
    some = np.arange(size)
    while True:
        share = np.linalg.solve(error[np.ix_(some, some)], np.ones(len(some)))
        share /= share.sum()
        if (share >= 0.0).all():
            break
        some = some[share > 0.0]
    result = np.zeros(size)
    result[some] = share
    return result
