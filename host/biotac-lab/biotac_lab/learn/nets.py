"""A perceptron of one tanh layer and linear outputs: Wettels and Loeb 2011, Eq 1-3, by scikit-learn.

The paper trains by Levenberg-Marquardt with Bayesian regularisation and stops by held-out rows: levenberg.py does, and
takes longer. Here it is L-BFGS, with the weight decay that is best on such rows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from biotac import InputError

from .inputs import Reduction

Floats = npt.NDArray[np.float64]

STEPS = 400
DECAYS = (0.01, 0.1, 1.0, 10.0)  # of the squared weights, per row
DECAY = 0.1  # where no rows are set aside


@dataclass(frozen=True)
class Net:
    """A trained net; inputs and targets are centred and divided by ``scale`` and ``target_scale``."""

    mean: Floats
    scale: Floats
    target_mean: Floats
    target_scale: float
    model: Any
    reduction: Reduction | None = None

    def after(self, reduction: Reduction) -> Net:
        """The same net, with the ``reduction`` of the given columns as inputs."""
        return replace(self, reduction=reduction)

    def __call__(self, inputs: npt.ArrayLike) -> Floats:
        """Outputs (n, k) for inputs (n, d), in the target's unit; NaN rows stay NaN."""
        x = np.asarray(inputs, dtype=np.float64) if self.reduction is None else self.reduction(inputs)
        if x.ndim != 2 or x.shape[1] != len(self.mean):
            raise InputError(f"inputs have shape {x.shape}: expected (n, {len(self.mean)}), as in training")
        result = np.full((len(x), len(self.target_mean)), np.nan)
        known = np.isfinite(x).all(axis=1)
        if known.any():
            outputs = self.model.predict((x[known] - self.mean) / self.scale).reshape(-1, len(self.target_mean))
            result[known] = outputs * self.target_scale + self.target_mean
        return result


def train(
    inputs: npt.ArrayLike,
    targets: npt.ArrayLike,
    aside: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    *,
    units: int | None = None,
    seed: int = 0,
    steps: int = STEPS,
) -> Net:
    """Fit ``targets`` (n, k) to ``inputs`` (n, d); ``aside`` is such a pair of held-out rows to choose among DECAYS.

    ``units`` defaults to twice the number of inputs, as in the paper. Targets are divided by one deviation for all, so
    that the errors of all outputs weigh the same. Raises InputError for other shapes, or values that are not finite.
    """
    from sklearn.neural_network import MLPRegressor  # half a second to import

    x, t, mean, scale, target_mean, target_scale = scaled(inputs, targets)
    best, least = None, np.inf
    for decay in (DECAY,) if aside is None else DECAYS:
        hidden = (units or 2 * x.shape[1],)
        model = MLPRegressor(
            hidden_layer_sizes=hidden, activation="tanh", solver="lbfgs", alpha=decay, max_iter=steps,
            max_fun=10 * steps, random_state=seed,
        )  # fmt: skip
        model.fit((x - mean) / scale, ((t - target_mean) / target_scale).squeeze())
        net = Net(mean, scale, target_mean, target_scale, model)
        if aside is None:
            return net
        other, wanted = _pair(*aside)
        error = float(((net(other) - wanted) ** 2).sum())
        best, least = (net, error) if error < least else (best, least)
    assert best is not None
    return best


def scaled(inputs: npt.ArrayLike, targets: npt.ArrayLike) -> tuple[Floats, Floats, Floats, Floats, Floats, float]:
    """Inputs and targets, and the mean and deviation of each: (d,) and (d,), (k,) and one for all targets."""
    x, t = _pair(inputs, targets)
    deviation, target_mean = x.std(axis=0), t.mean(axis=0)
    target_scale = float(np.sqrt(((t - target_mean) ** 2).mean())) or 1.0
    return x, t, x.mean(axis=0), np.where(deviation > 0.0, deviation, 1.0), target_mean, target_scale


def _pair(inputs: npt.ArrayLike, targets: npt.ArrayLike) -> tuple[Floats, Floats]:
    x, t = np.asarray(inputs, dtype=np.float64), np.asarray(targets, dtype=np.float64)
    if x.ndim != 2 or t.ndim != 2 or len(x) != len(t) or len(x) < 2:
        raise InputError(f"inputs {x.shape} and targets {t.shape}: expected (n, d) and (n, k) with n at least 2")
    if not (np.isfinite(x).all() and np.isfinite(t).all()):
        raise InputError("inputs or targets contain NaN or infinity: expected finite numbers; drop those rows")
    return x, t
