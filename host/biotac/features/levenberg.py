"""A perceptron of one tanh layer and linear outputs, trained by Levenberg-Marquardt with Bayesian regularisation.

Seed 000's Eq 1-3 and its training: Gauss-Newton on F = beta E_D + alpha E_W, where E_D and E_W are the sums of squared
errors and weights, damped by mu (Hagan and Menhaj 1994). alpha and beta come from MacKay's evidence (1992), updated in
each step as in Foresee and Hagan (1997). Held-out rows stop the training early. scikit-learn has neither method. The
outputs are linear, so J'J over all outputs is a product of the hidden layer's and W2's parts and costs as much as for
one output.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.linalg import cho_factor, cho_solve, lapack
from threadpoolctl import threadpool_limits

from ..errors import InputError

Floats = npt.NDArray[np.float64]

STEPS = 60
PATIENCE = 5  # seed 000: stop after five iterations without improvement
MU, MU_DOWN, MU_UP, MU_MAX = 5e-3, 0.1, 10.0, 1e10  # the Neural Network Toolbox's trainbr
_ROWS = 4096  # rows of the Jacobian at a time


@dataclass(frozen=True)
class Net:
    """A trained net: ``hidden`` (inputs + 1, units) and ``output`` (units + 1, outputs), with the biases last.

    Its weights are for scaled inputs and targets. ``gamma`` is how many of the ``weights`` the data determines.
    ``steps`` is how many steps were taken; the weights kept are the best on the held-out rows.
    """

    mean: Floats
    scale: Floats
    target_mean: Floats
    target_scale: Floats
    hidden: Floats
    output: Floats
    gamma: float
    steps: int

    @property
    def weights(self) -> int:
        """Number of weights and biases."""
        return self.hidden.size + self.output.size

    def __call__(self, inputs: npt.ArrayLike) -> Floats:
        """Outputs (n, k) for inputs (n, d), in the target's unit; NaN rows stay NaN."""
        x = np.asarray(inputs, dtype=np.float64)
        if x.ndim != 2 or x.shape[1] != len(self.mean):
            raise InputError(f"inputs have shape {x.shape}: expected (n, {len(self.mean)}), as in training")
        said = _forward((x - self.mean) / self.scale, self.hidden, self.output)[1]
        return said * self.target_scale + self.target_mean


def train(
    inputs: npt.ArrayLike,
    targets: npt.ArrayLike,
    aside: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    *,
    units: int | None = None,
    seed: int = 0,
    steps: int = STEPS,
) -> Net:
    """Fit ``targets`` (n, k) to ``inputs`` (n, d); ``aside`` is such a pair of held-out rows for early stopping.

    ``units`` defaults to twice the number of inputs (seed 000). Inputs are centred and divided by their standard
    deviations. Targets are centred and divided by one deviation for all, so that the errors of all outputs weigh the
    same, as they do in their own unit. Raises InputError for other shapes, or values that are not finite.
    """
    x, t = _pair(inputs, targets)
    mean, deviation = x.mean(axis=0), x.std(axis=0)
    scale = np.where(deviation > 0.0, deviation, 1.0)
    target_mean = t.mean(axis=0)
    spread = float(np.sqrt(((t - target_mean) ** 2).mean()))
    target_scale = np.full(t.shape[1], spread or 1.0)
    x, t = (x - mean) / scale, (t - target_mean) / target_scale
    kept = None
    if aside is not None:
        other, wanted = _pair(*aside)
        kept = (other - mean) / scale, (wanted - target_mean) / target_scale
    units = 2 * x.shape[1] if units is None else units
    rng = np.random.default_rng([seed, 7])
    hidden = rng.normal(0.0, 1.0, (x.shape[1] + 1, units)) / np.sqrt(x.shape[1])
    output = rng.normal(0.0, 1.0, (units + 1, t.shape[1])) / np.sqrt(units)
    with threadpool_limits(limits=1, user_api="blas"):  # many small systems: threads would wait for each other
        hidden, output, gamma, taken = _descend(x, t, kept, hidden, output, steps)
    return Net(mean, scale, target_mean, target_scale, hidden, output, gamma, taken)


def _pair(inputs: npt.ArrayLike, targets: npt.ArrayLike) -> tuple[Floats, Floats]:
    x, t = np.asarray(inputs, dtype=np.float64), np.asarray(targets, dtype=np.float64)
    if x.ndim != 2 or t.ndim != 2 or len(x) != len(t) or len(x) < 2:
        raise InputError(f"inputs {x.shape} and targets {t.shape}: expected (n, d) and (n, k) with n at least 2")
    if not (np.isfinite(x).all() and np.isfinite(t).all()):
        raise InputError("inputs or targets contain NaN or infinity: expected finite numbers; drop those rows")
    return x, t


def _forward(x: Floats, hidden: Floats, output: Floats) -> tuple[Floats, Floats]:
    z: Floats = np.tanh(x @ hidden[:-1] + hidden[-1])
    said: Floats = z @ output[:-1] + output[-1]
    return z, said


def squared_jacobian(x: Floats, t: Floats, hidden: Floats, output: Floats) -> tuple[Floats, Floats, float]:
    """J'J (p, p), J'e (p,) and e'e for e = said - t over all rows and outputs.

    The p weights are those of ``hidden`` row by row, then those of ``output``. With Z = [z, 1], A = (1 - z^2) (x)
    [x, 1] and W the output weights, J'J is (A'A) * (W W') for the hidden weights, Z'Z for each output's own, and
    W_k * (A'Z) between them.
    """
    d, units = hidden.shape
    first, second = d * units, output.shape[1]
    aa, az = np.zeros((first, first)), np.zeros((first, units + 1))
    zz, ze = np.zeros((units + 1, units + 1)), np.zeros((units + 1, second))
    slope, squares = np.zeros(first), 0.0
    for k in range(0, len(x), _ROWS):
        part = x[k : k + _ROWS]
        z, said = _forward(part, hidden, output)
        error = said - t[k : k + _ROWS]
        one = np.ones((len(part), 1))
        big, full = np.hstack([part, one]), np.hstack([z, one])
        bent = 1.0 - z**2
        a = (big[:, :, None] * bent[:, None, :]).reshape(len(part), first)
        aa += a.T @ a
        az += a.T @ full
        zz += full.T @ full
        ze += full.T @ error
        slope += (big.T @ (bent * (error @ output[:-1].T))).ravel()
        squares += float((error**2).sum())
    weight = np.tile(output[:-1], (d, 1))  # of each hidden weight's unit, (first, second)
    total = first + output.size
    jj = np.zeros((total, total))
    jj[:first, :first] = aa * (weight @ weight.T)
    for k in range(second):
        rows = first + np.arange(units + 1) * second + k
        jj[:first, rows] = az * weight[:, k : k + 1]
        jj[rows, :first] = jj[:first, rows].T
        jj[np.ix_(rows, rows)] = zz
    return jj, np.concatenate([slope, ze.ravel()]), squares


def _descend(
    x: Floats, t: Floats, kept: tuple[Floats, Floats] | None, hidden: Floats, output: Floats, steps: int
) -> tuple[Floats, Floats, float, int]:
    w = np.concatenate([hidden.ravel(), output.ravel()])
    alpha, beta, gamma, mu = 1e-2, 1.0, float(len(w)), MU

    def layers(its: Floats) -> tuple[Floats, Floats]:
        return its[: hidden.size].reshape(hidden.shape), its[hidden.size :].reshape(output.shape)

    def squares(its: Floats, rows: Floats, wanted: Floats) -> float:
        return float(((_forward(rows, *layers(its))[1] - wanted) ** 2).sum())

    best, least, waited, taken = w, np.inf, 0, 0
    diagonal = np.diag_indices(len(w))
    for _ in range(steps):
        jj, je, data = squared_jacobian(x, t, *layers(w))
        cost = beta * data + alpha * float(w @ w)
        step = None
        while mu <= MU_MAX:
            system = beta * jj
            system[diagonal] += alpha + mu
            tried = w - cho_solve(cho_factor(system, overwrite_a=True), beta * je + alpha * w)
            after = squares(tried, x, t)
            if beta * after + alpha * float(tried @ tried) < cost:
                step, mu = tried, max(mu * MU_DOWN, 1e-20)
                break
            mu *= MU_UP
        if step is None:
            break
        w, data = step, after
        taken += 1
        # with the Hessian from before the step: a new one would cost as much as the step itself
        gamma = _gamma(jj, alpha, beta)
        alpha = gamma / max(2.0 * float(w @ w), 1e-12)
        beta = max(t.size - gamma, 1.0) / max(2.0 * data, 1e-12)
        if kept is None:
            best = w
            continue
        now = squares(w, *kept)
        best, waited = (w, 0) if now < least else (best, waited + 1)
        least = min(least, now)
        if waited >= PATIENCE:
            break
    return (*layers(best), gamma, taken)


def _gamma(jj: Floats, alpha: float, beta: float) -> float:
    """Number of weights that the data determines: p - alpha tr((beta J'J + alpha)^-1)."""
    system = beta * jj
    system[np.diag_indices(len(jj))] += alpha
    factor, _ = cho_factor(system, lower=True, overwrite_a=True)
    inverse, _ = lapack.dpotri(factor, lower=1, overwrite_c=1)
    return float(len(jj) - alpha * np.trace(inverse))
