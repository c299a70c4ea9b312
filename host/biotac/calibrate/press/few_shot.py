"""The population map improved with a little data of a new finger: presses on a scale, weights, a minute on a plate.

All are one regression: coefficients have a prior, the map of other fingers or the normals of the electrodes, and a
spread about it. z is measured, or all axes, or the force along a plate's normal.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ...errors import InputError
from ...kernels.geometry import Floats
from ..population import Population, Sums, normals

# How much fingers differ in the two numbers, and the map's error in one press: from F1 and F2, each by the other's map.
GAIN_SPREAD = 0.04
BALANCE_SPREAD = 0.1
PRESS_ERROR_N = (0.45, 0.35, 0.35)  # x, y, z
WEIGHT_S = 3.0  # how many seconds of recording a press of known force counts as
PULL = 1000.0  # weight of the population map against the finger's own data, in seconds of recording: from F1 and F2


@dataclass(frozen=True)
class Way:
    """How a finger was pressed, by ``name``, and the parameters fitted to that; ``size`` names the source of the force.

    First come the shares of the map's axes (rows) in the finger's (columns), each number within ``spread`` (3, 3);
    where that is None, the gain of the electrodes' normals. With ``columns``, the coefficients of all columns follow.
    """

    name: str
    size: str
    spread: Floats | None
    columns: bool


SCALE = Way(
    "presses on a scale",
    "the scale's unit (--unit kg, g or N; 1 lbf is 4.45 N)",
    np.array([[0, 0, 0], [0, 0, 0], [BALANCE_SPREAD, 0, GAIN_SPREAD]]),
    columns=False,
)
WEIGHTS = Way("weights on tilted blocks", "the masses (--masses, in grams)", np.full((3, 3), 0.1), columns=True)
PLATE = Way("presses of a plate", "", None, columns=True)


@dataclass(frozen=True)
class Scale:
    """A finger's correction: ``gain`` of F_z, and ``balance``, the share of F_z subtracted from F_x.

    The sigmas are the uncertainty after presses: the difference between fingers, less the presses' evidence.
    """

    gain: float = 1.0
    balance: float = 0.0
    gain_sigma: float = GAIN_SPREAD
    balance_sigma: float = BALANCE_SPREAD

    def applied(self, force: Floats) -> Floats:
        """The population map's force (n, 3) in N, corrected."""
        x = force[:, 0] - self.balance * force[:, 2]
        return np.column_stack([x, force[:, 1], self.gain * force[:, 2]])


def scale_of(felt_n: Floats, force_n: Floats, way: Way = SCALE) -> Scale:
    """The correction from presses, by the map's force ``felt_n`` (k, 3) and the true one (k, 3), both in N.

    Both numbers are pulled towards their defaults, the more the larger the map's error in one press is against their
    spread over fingers. Raises InputError for a force on a scale that is not above 0.
    """
    mixing, sigma = _mixing(felt_n, force_n, way)
    return Scale(*map(float, (mixing[2, 2], -mixing[2, 0], sigma[2, 2], sigma[2, 0])))


def fit(population: Population, columns: Floats, force_n: Floats, way: Way) -> Population:
    """The map fitted to presses: mean ``columns`` (k, 114) of each, and its force (k, 3) in N. Raises as scale_of."""
    known = population.coefficients
    if way.spread is None:
        felt_n = columns @ normals()  # the population's own leaning belongs to a rig, and is omitted
        known = (felt_n * force_n).sum() / (felt_n**2).sum() * normals()
    else:
        known = known @ _mixing(columns @ known, force_n, way)[0]
    mixed = replace(population, coefficients=known)
    if not way.columns:
        return mixed
    return shrink_to(mixed, Sums(columns.T @ columns, columns.T @ force_n, columns.sum(axis=0)), WEIGHT_S)


def shrink_to(population: Population, new: Sums, seconds: float) -> Population:
    """The map fitted to a finger's ``new`` sums, each worth ``seconds`` of recording, and pulled to ``population``."""
    spread = np.tile(1.0 / np.sqrt(PULL * population.variance), (new.cross.shape[1], 1)).T
    found, _ = _regress(population.coefficients, spread, 1.0, seconds * new.gram, seconds * new.cross)
    return replace(population, coefficients=found)


def _mixing(felt_n: Floats, force_n: Floats, way: Way) -> tuple[Floats, Floats]:
    assert way.spread is not None
    pressed = np.column_stack([felt_n[:, 2], force_n[:, 2]])
    if way is SCALE and not (np.isfinite(pressed) & (pressed > 0.0)).all():
        felt, read = (np.array2string(values, precision=1) for values in pressed.T)
        raise InputError(
            f"presses of {felt} N by the map, {read} N on the scale: expected all above 0; tare the finger, and "
            "press its pad straight down, about E17: at E18 and E19 the map does not reach"
        )
    return _regress(np.eye(3), way.spread, PRESS_ERROR_N, felt_n.T @ felt_n, felt_n.T @ force_n)


def _regress(prior: Floats, spread: Floats, error: npt.ArrayLike, gram: Floats, cross: Floats) -> tuple[Floats, Floats]:
    """The likeliest coefficients (q, axes), and one sigma of each; one with ``spread`` 0 stays at ``prior``.

    ``gram`` (q, q) and ``cross`` (q, axes) are sums over rows, each known to ``error``, one number or (axes,).
    """
    mean, sigma, left = prior.copy(), np.zeros_like(prior), cross - gram @ prior
    for axis, row_error in enumerate(np.broadcast_to(np.asarray(error), prior.shape[1])):
        free = np.flatnonzero(spread[:, axis])
        weight = gram[np.ix_(free, free)] + np.diag((row_error / spread[free, axis]) ** 2)
        mean[free, axis] += np.linalg.solve(weight, left[free, axis])
        sigma[free, axis] = row_error * np.sqrt(np.diag(np.linalg.inv(weight)))
    return mean, sigma
