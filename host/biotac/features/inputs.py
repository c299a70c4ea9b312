"""What goes into a net in place of the electrodes: seed 000, II.D2. All three are linear."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.stats import spearmanr
from sklearn.decomposition import PCA, FastICA

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

LEAST_VARIANCE = 1e-3  # seed 000: components with more than 0.1 % of the variance
LEAST_CORRELATION = 0.1  # seed 000: electrodes with a Spearman coefficient above it


@dataclass(frozen=True)
class Reduction:
    """Columns (n, d) to inputs (n, k): (x - mean) / scale @ matrix, of ``mean`` (d,), ``scale`` (d,) and (d, k)."""

    mean: Floats
    scale: Floats
    matrix: Floats

    def __call__(self, columns: npt.ArrayLike) -> Floats:
        result: Floats = (np.asarray(columns, dtype=np.float64) - self.mean) / self.scale @ self.matrix
        return result


Reduce = Callable[[Floats], Reduction]


def every(columns: Floats) -> Reduction:
    """All of them, centred and over their deviation."""
    deviation = columns.std(axis=0)
    return Reduction(columns.mean(axis=0), np.where(deviation > 0.0, deviation, 1.0), np.eye(columns.shape[1]))


def principal(columns: Floats, least: float = LEAST_VARIANCE, most: int | None = None) -> Reduction:
    """Principal components, those with more than ``least`` of the variance and at most ``most`` of them."""
    plain = every(columns)
    found = PCA(svd_solver="full").fit(plain(columns))
    kept = found.components_[found.explained_variance_ratio_ > least][:most]
    return Reduction(plain.mean, plain.scale, kept.T)


def independent(columns: Floats, least: float = LEAST_VARIANCE, seed: int = 0) -> Reduction:
    """FastICA's components, as many as principal() keeps; those that did not converge are as they were then."""
    import warnings

    plain = principal(columns, least)
    whitened = plain(columns)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "did not converge": that ICA does badly here is the paper's finding, too
        found = FastICA(whiten="unit-variance", random_state=seed, max_iter=200).fit(whitened)
    return Reduction(plain.mean, plain.scale, plain.matrix @ found.components_.T)


def correlations(columns: Floats, force_n: Floats) -> Floats:
    """Absolute Spearman coefficient (d, 3) of each column with each force (n, 3): seed 000's figure 6."""
    d = columns.shape[1]
    both = spearmanr(np.hstack([columns, force_n])).statistic
    result: Floats = np.abs(both[:d, d:])
    return result


def correlated(columns: Floats, force_n: Floats, least: float = LEAST_CORRELATION) -> Bools:
    """Which columns (d, 3) follow each force by more than ``least``."""
    result: Bools = correlations(columns, force_n) > least
    return result


def only(columns: Floats, kept: Bools) -> Reduction:
    """The ``kept`` (d,) of the columns."""
    plain = every(columns)
    return Reduction(plain.mean, plain.scale, plain.matrix[:, kept])
