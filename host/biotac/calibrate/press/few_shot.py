"""The population map improved with a little data of a new finger: presses on a scale, weights, a minute on a plate."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...core.geometry import Floats
from ...errors import InputError
from ..population import Population, Sums, normals

# How much fingers differ in the two numbers, and the map's error in one press: from F1 and F2, each by the other's map.
GAIN_SPREAD = 0.04
BALANCE_SPREAD = 0.1
PRESS_ERROR_N = (0.45, 0.35, 0.35)  # x, y, z

# Weights give the whole force vector: how far axes may mix into each other, and how many seconds a weight counts as.
MIXING_SPREAD = 0.1
WEIGHT_S = 3.0
PULL = 1000.0  # weight of the population map against the finger's own data, in seconds of recording: from F1 and F2


@dataclass(frozen=True)
class Scale:
    """A finger's correction: ``gain`` of F_z, and ``balance``, the share of F_z subtracted from F_x.

    The sigmas are how unsure presses leave them: as much as fingers differ, less what the presses say.
    """

    gain: float = 1.0
    balance: float = 0.0
    gain_sigma: float = GAIN_SPREAD
    balance_sigma: float = BALANCE_SPREAD

    def applied(self, force: Floats) -> Floats:
        """The population map's force (n, 3) in N, corrected."""
        x = force[:, 0] - self.balance * force[:, 2]
        return np.column_stack([x, force[:, 1], self.gain * force[:, 2]])

    def on(self, population: Population) -> Population:
        """The map with the correction in its coefficients."""
        return replace(population, coefficients=self.applied(population.coefficients))


def scale_of(felt_n: Floats, shown_n: Floats) -> Scale:
    """The correction from presses straight down, by the map's force ``felt_n`` (k, 3) and the scale's (k,), both in N.

    Both numbers are pulled towards their defaults, the more the larger the map's error in one press is against their
    spread over fingers. Raises InputError for a force that is not above 0.
    """
    z = felt_n[:, 2]
    if not np.isfinite(z).all() or (shown_n <= 0.0).any() or (z <= 0.0).any():
        felt, read = (np.array2string(values, precision=1) for values in (z, shown_n))
        raise InputError(
            f"presses of {felt} N by the map, {read} N on the scale: expected all above 0; tare the finger, and press "
            "its pad straight down"
        )
    size = float(z @ z)
    for_gain = size + (PRESS_ERROR_N[2] / GAIN_SPREAD) ** 2
    for_balance = size + (PRESS_ERROR_N[0] / BALANCE_SPREAD) ** 2
    gain, balance = 1.0 + float(z @ (shown_n - z)) / for_gain, float(z @ felt_n[:, 0]) / for_balance
    return Scale(gain, balance, PRESS_ERROR_N[2] / for_gain**0.5, PRESS_ERROR_N[0] / for_balance**0.5)


def scaled(population: Population, columns: Floats, force_n: Floats) -> Population:
    """The map corrected by scale_of() presses: mean ``columns`` (k, 114) of each and its force (k, 3) in N, along z."""
    return scale_of(columns @ population.coefficients, force_n[:, 2]).on(population)


def mixing_of(felt_n: Floats, force_n: Floats) -> tuple[Floats, Floats]:
    """The mixing (3, 3) of the map's axes, felt to true, from forces (k, 3) in N, and one sigma of each number."""
    mixing, sigma = np.eye(len(PRESS_ERROR_N)), np.empty((len(PRESS_ERROR_N),) * 2)
    for axis, error_n in enumerate(PRESS_ERROR_N):
        unsure = np.linalg.inv(felt_n.T @ felt_n + (error_n / MIXING_SPREAD) ** 2 * np.eye(len(mixing)))
        mixing[:, axis] += unsure @ felt_n.T @ (force_n - felt_n)[:, axis]
        sigma[:, axis] = error_n * np.sqrt(np.diag(unsure))
    return mixing, sigma


def weighed(population: Population, columns: Floats, force_n: Floats) -> Population:
    """The map fitted to weights: mean ``columns`` (k, 114) while each lay still, and its force (k, 3) in N.

    A mixing of the axes, nine numbers, is fitted first; what it leaves then changes the columns' coefficients.
    """
    mixing, _ = mixing_of(columns @ population.coefficients, force_n)
    return _pulled_by_presses(replace(population, coefficients=population.coefficients @ mixing), columns, force_n)


def plated(population: Population, columns: Floats, force_n: Floats) -> Population:
    """A map of the compressed electrodes' normals, fitted to presses of a flat plate from all sides.

    ``columns`` (k, 114) are means of each press, ``force_n`` (k, 3) is against the skin's normal there, in N. The
    population's own leaning is left out: it is that of a rig.
    """
    felt_n = columns @ normals()
    gain = (felt_n * force_n).sum() / (felt_n**2).sum()
    return _pulled_by_presses(replace(population, coefficients=gain * normals()), columns, force_n)


def _pulled_by_presses(population: Population, columns: Floats, force_n: Floats) -> Population:
    k = len(columns)
    mean = Sums(columns.T @ columns / k, columns.T @ force_n / k, columns.mean(axis=0))
    return pulled(population, mean, WEIGHT_S * k)


def pulled(population: Population, new: Sums, seconds: float) -> Population:
    """The map pulled towards a finger's own ``new`` sums, weighted as ``seconds`` of recording on a force plate."""
    pull = PULL * np.diag(population.variance)
    change = np.linalg.solve(seconds * new.gram + pull, seconds * (new.cross - new.gram @ population.coefficients))
    return replace(population, coefficients=population.coefficients + change)
