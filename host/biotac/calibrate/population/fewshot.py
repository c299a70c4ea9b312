"""What little of a new finger adds to the population map: presses on a scale, weights, or a minute on a force plate."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...core.geometry import Floats
from ...errors import InputError
from .training import Population, Sums

# How much fingers differ in the two numbers, and how far the map is off in one press: F1 and F2, each by the other's.
GAIN_SPREAD = 0.04
BALANCE_SPREAD = 0.1
PRESS_ERROR_N = (0.45, 0.35, 0.35)  # x, y, z

# Weights tell all of the force: how far each axis may be mixed into each, and how many seconds one is worth.
MIXING_SPREAD = 0.1
WEIGHT_S = 3.0
PULL = 1000.0  # seconds of recording that a spread of one column's standard deviation is worth: F1 and F2


@dataclass(frozen=True)
class Scale:
    """``gain`` of F_z, and ``balance``: what of F_z is taken from F_x. Both say nothing of a finger at 1 and 0."""

    gain: float = 1.0
    balance: float = 0.0

    def applied(self, force: Floats) -> Floats:
        """To the population's force (n, 3) in N."""
        x = force[:, 0] - self.balance * force[:, 2]
        return np.column_stack([x, force[:, 1], self.gain * force[:, 2]])

    def on(self, its: Population) -> Population:
        """The map with both in it."""
        return replace(its, coefficients=self.applied(its.coefficients))


def scale_of(said: Floats, shown_n: Floats) -> Scale:
    """From presses straight down: the map's force (k, 3) in each, N, and what the scale showed (k,), N.

    Each number is pulled to what it is on most fingers, by how far the map is off in one press. Raises InputError for
    presses that say nothing.
    """
    z = said[:, 2]
    if not np.isfinite(z).all() or (shown_n <= 0.0).any() or (z <= 0.0).any():
        felt, read = (np.array2string(values, precision=1) for values in (z, shown_n))
        raise InputError(
            f"presses of {felt} N by the map, {read} N on the scale: expected all above 0; tare the finger, and press "
            "its pad straight down"
        )
    size = float(z @ z)
    gain = 1.0 + float(z @ (shown_n - z)) / (size + (PRESS_ERROR_N[2] / GAIN_SPREAD) ** 2)
    balance = float(z @ said[:, 0]) / (size + (PRESS_ERROR_N[0] / BALANCE_SPREAD) ** 2)
    return Scale(gain, balance)


def scaled(its: Population, columns: Floats, force_n: Floats) -> Population:
    """The map with scale_of() presses: ``columns`` (k, 323), means over each, and force (k, 3) in N, all of it z."""
    return scale_of(columns @ its.coefficients, force_n[:, 2]).on(its)


def weighed(its: Population, columns: Floats, force_n: Floats) -> Population:
    """The map moved to weights: ``columns`` (k, 323), a mean while each lay still, and its force (k, 3) in N.

    What they say first goes into a mixing of the axes, nine numbers; what that leaves then moves single columns.
    """
    said = columns @ its.coefficients
    mixing = np.eye(len(PRESS_ERROR_N))
    for axis, error_n in enumerate(PRESS_ERROR_N):
        pull = (error_n / MIXING_SPREAD) ** 2 * np.eye(len(mixing))
        mixing[:, axis] += np.linalg.solve(said.T @ said + pull, said.T @ (force_n - said)[:, axis])
    mixed = replace(its, coefficients=its.coefficients @ mixing)
    k = len(columns)
    mean = Sums(columns.T @ columns / k, columns.T @ force_n / k, columns.mean(axis=0))
    return pulled(mixed, mean, WEIGHT_S * k)


def pulled(its: Population, new: Sums, seconds: float) -> Population:
    """The map moved to a finger's own ``seconds`` on a force plate, as far as they are worth it."""
    pull = PULL * np.diag(its.variance)
    change = np.linalg.solve(seconds * new.gram + pull, seconds * (new.cross - new.gram @ its.coefficients))
    return replace(its, coefficients=its.coefficients + change)
