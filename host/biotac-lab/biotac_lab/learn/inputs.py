"""The inputs of a net in place of the electrodes (Wettels and Loeb 2011, II.D2): linear reductions of the columns."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

LEAST_VARIANCE = 1e-3  # the paper: components with more than 0.1 % of the variance
LEAST_CORRELATION = 0.1  # the paper: electrodes with a Spearman coefficient above it


@dataclass(frozen=True)
class Reduction:
    """From columns (n, d) to inputs (n, k): (x - mean) / scale @ matrix.

    ``mean`` and ``scale`` are (d,), ``matrix`` is (d, k).
    """

    mean: Floats
    scale: Floats
    matrix: Floats

    def __call__(self, columns: npt.ArrayLike) -> Floats:
        return (np.asarray(columns, dtype=np.float64) - self.mean) / self.scale @ self.matrix


Reduce = Callable[[Floats], Reduction]


def every(columns: Floats) -> Reduction:
    """All columns, centred and divided by their standard deviation.

    The paper says "dividing by the variance", which makes a quiet channel louder than a loud one. The toolbox's own
    scaling of inputs (mapminmax) undid any such division, as nets.scaled() does here.
    """
    deviation = columns.std(axis=0)
    return Reduction(columns.mean(axis=0), np.where(deviation > 0.0, deviation, 1.0), np.eye(columns.shape[1]))


def principal(columns: Floats, least: float = LEAST_VARIANCE, most: int | None = None) -> Reduction:
    """The principal components with more than ``least`` of the variance, at most ``most`` of them."""
    from sklearn.decomposition import PCA  # half a second to import

    plain = every(columns)
    found = PCA(svd_solver="full").fit(plain(columns))
    kept = found.components_[found.explained_variance_ratio_ > least][:most]
    return Reduction(plain.mean, plain.scale, kept.T)


def independent(columns: Floats) -> Reduction:
    """FastICA's components, as many as principal() has.

    Where it does not converge, they are those of the last iteration.
    """
    import warnings

    from sklearn.decomposition import FastICA  # half a second to import

    plain = principal(columns)
    whitened = plain(columns)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # "did not converge": the paper, too, finds that ICA does badly here
        found = FastICA(whiten="unit-variance", random_state=0, max_iter=200).fit(whitened)
    return Reduction(plain.mean, plain.scale, plain.matrix @ found.components_.T)


def correlations(columns: Floats, force_n: Floats) -> Floats:
    """Absolute Spearman coefficient (d, 3) of each column with each axis of the force (n, 3): the paper's figure 6."""
    d = columns.shape[1]
    both = scipy.stats.spearmanr(np.hstack([columns, force_n])).statistic
    result: Floats = np.abs(both[:d, d:])
    return result


def correlated(columns: Floats, force_n: Floats) -> Bools:
    """Mask (d, 3) of the columns with correlations() with each axis of the force above LEAST_CORRELATION."""
    return correlations(columns, force_n) > LEAST_CORRELATION


def only(columns: Floats, kept: Bools) -> Reduction:
    """The columns where ``kept`` (d,) is true, centred and divided by their standard deviation."""
    plain = every(columns)
    return Reduction(plain.mean, plain.scale, plain.matrix[:, kept])
