"""The trainer of Wettels and Loeb 2011, II.B: Levenberg-Marquardt, Bayesian regularisation, early stopping.

A Levenberg-Marquardt step is the trust region's with the Gauss-Newton matrix as the Hessian (More 1978), which SciPy's
trust-exact takes. Bayesian regularisation is MacKay's (1992), by Foresee and Hagan (1997): the errors weigh beta and
the squared weights alpha, set anew after each round from how many weights the data determine. Training stops when the
held-out rows have not improved for five iterations, as in the paper, and the best weights count.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy

from . import nets
from .nets import Floats

PATIENCE = 5  # iterations
ROUND = 10  # iterations between two settings of alpha and beta


@dataclass
class Perceptron:
    """``hidden`` (units, d + 1) and ``outer`` (k, units + 1), the last column of each the biases: Eq 1 to 3."""

    hidden: Floats
    outer: Floats

    def predict(self, inputs: Floats) -> Floats:
        """Outputs (n, k) for inputs (n, d)."""
        z = np.tanh(inputs @ self.hidden[:, :-1].T + self.hidden[:, -1])
        result: Floats = z @ self.outer[:, :-1].T + self.outer[:, -1]
        return result


class _Problem:
    """Errors, gradient and Gauss-Newton matrix of beta E_D + alpha E_W, for all weights in one vector."""

    def __init__(self, x: Floats, t: Floats, units: int) -> None:
        self.x, self.t = np.column_stack([x, np.ones(len(x))]), t
        self.shapes = (units, self.x.shape[1]), (t.shape[1], units + 1)
        self.alpha, self.beta = 0.01, 1.0
        self._seen: tuple[bytes, Floats, Floats, Floats, Floats] | None = None

    def split(self, weights: Floats) -> tuple[Floats, Floats]:
        cut = self.shapes[0][0] * self.shapes[0][1]
        return weights[:cut].reshape(self.shapes[0]), weights[cut:].reshape(self.shapes[1])

    def at(self, weights: Floats) -> tuple[Floats, Floats, Floats, Floats]:
        """Outer weights without bias, z with a one (n, units + 1), tanh's slope (n, units), errors (n, k)."""
        key = weights.tobytes()
        if self._seen is None or self._seen[0] != key:
            hidden, outer = self.split(weights)
            z = np.tanh(self.x @ hidden.T)
            ones = np.column_stack([z, np.ones(len(z))])
            self._seen = key, outer[:, :-1], ones, 1.0 - z**2, ones @ outer.T - self.t
        return self._seen[1:]

    def value(self, weights: Floats) -> float:
        error = self.at(weights)[3]
        return float(self.beta * (error**2).sum() + self.alpha * (weights @ weights)) / 2.0

    def gradient(self, weights: Floats) -> Floats:
        outer, z, slope, error = self.at(weights)
        parts = ((error @ outer) * slope).T @ self.x, error.T @ z
        return self.beta * np.concatenate([part.ravel() for part in parts]) + self.alpha * weights

    def gauss_newton(self, weights: Floats) -> Floats:
        """J^T J of the errors: an output's slope is an outer weight times a common factor; one product does for all."""
        outer, z, slope, _ = self.at(weights)
        (units, width), (k, columns) = self.shapes
        shared = (slope[:, :, None] * self.x[:, None, :]).reshape(len(z), -1)
        both = (shared.T @ shared) * np.kron(outer.T @ outer, np.ones((width, width)))
        cross = np.einsum("kj,jwc->jwkc", outer, (shared.T @ z).reshape(units, width, columns))
        cross = cross.reshape(units * width, k * columns)
        return np.block([[both, cross], [cross.T, np.kron(np.eye(k), z.T @ z)]])

    def hessian(self, weights: Floats) -> Floats:
        matrix = self.beta * self.gauss_newton(weights)
        matrix[np.diag_indices_from(matrix)] += self.alpha
        return matrix

    def regularise(self, weights: Floats) -> None:
        """Alpha and beta from the number of weights that the data determine."""
        known = np.maximum(np.linalg.eigvalsh(self.gauss_newton(weights)), 0.0) * self.beta
        determined = float((known / (known + self.alpha)).sum())
        errors = max(float((self.at(weights)[3] ** 2).sum()), 1e-12)
        self.alpha = determined / float(weights @ weights)
        self.beta = max(self.t.size - determined, 1.0) / errors


def train(
    inputs: Floats, targets: Floats, aside: tuple[Floats, Floats], *, units: int | None = None, seed: int = 0,
    steps: int = 100,
) -> nets.Net:  # fmt: skip
    """As nets.train(): ``targets`` (n, k) from ``inputs`` (n, d), at most ``steps`` iterations; ``aside`` stops it."""
    x, t, mean, scale, target_mean, target_scale = nets.scaled(inputs, targets)
    problem = _Problem((x - mean) / scale, (t - target_mean) / target_scale, units or 2 * x.shape[1])
    rng = np.random.default_rng([seed, 40])
    parts = [rng.normal(0.0, shape[1] ** -0.5, shape) for shape in problem.shapes]
    weights: Floats = np.concatenate([part.ravel() for part in parts])
    other, wanted = (aside[0] - mean) / scale, (aside[1] - target_mean) / target_scale
    best, least, since, left, radius = weights, np.inf, 0, steps, 1.0

    def watch(intermediate_result: scipy.optimize.OptimizeResult) -> None:
        nonlocal best, least, since, left
        left -= 1
        now = intermediate_result.x
        error = float(((Perceptron(*problem.split(now)).predict(other) - wanted) ** 2).sum())
        best, least, since = (now.copy(), error, 0) if error < least else (best, least, since + 1)
        if since >= PATIENCE or left <= 0:
            raise StopIteration

    while left > 0 and since < PATIENCE:
        before = left
        found = scipy.optimize.minimize(
            problem.value, weights, jac=problem.gradient, hess=problem.hessian, method="trust-exact", callback=watch,
            options={"maxiter": min(ROUND, left), "initial_trust_radius": radius, "max_trust_radius": 100.0},
        )  # fmt: skip
        radius = min(max(float(np.linalg.norm(found.x - weights)) / ROUND, 1e-2), 100.0)
        weights = found.x
        if left == before:
            break  # converged
        problem.regularise(weights)
    return nets.Net(mean, scale, target_mean, target_scale, Perceptron(*problem.split(best)))
