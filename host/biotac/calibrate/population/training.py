"""The population map: the mean of two ridge fits, one for each family of columns, over drift and mirrored fingers.

See field.md 9. Columns have no offset and are 0 where counts are at their tare, so that rest is 0 N on any finger. A
finger's mirror image (left and right electrodes exchanged, F_y negated) is another possible finger, and the map is
trained on it too; for F_y only when asked, as fingers of one rig share the same asymmetry. A plate is never quite
parallel to the finger: the share of F_z in F_x over a whole recording comes from its mounting and from habit, and is
removed before training.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ...core import geometry as surface
from ...core import map_columns
from ...core.geometry import Floats
from ...core.map_columns import Signals
from ..wrench import features
from ..wrench.fitted import WrenchMap
from ..wrench.lag import Lags
from ..wrench.moments import DRIFT_NODES
from ..wrench.run import Run
from ..wrench.splits import Blocks

FAMILIES = (features.GATED, features.CONDUCTANCE_QUADRATIC)
ALL_COLUMNS = features.width(with_pdc=False)
INDEX: tuple[npt.NDArray[np.intp], ...] = tuple(family.index(ALL_COLUMNS) for family in FAMILIES)
COLUMNS = sum(len(index) for index in INDEX)
_STACKED = np.concatenate(INDEX)
_PARTS = tuple(np.split(np.arange(COLUMNS), np.cumsum([len(index) for index in INDEX])[:-1]))

DRIFT_SIGMA_COUNTS = 100.0  # what a finger drifts by in about two minutes of warm-up (biotac.md finding 6)
RIDGE = 2e-3  # of each column's variance
VARIANCE_FLOOR = 0.3  # of the median: a column that hardly varies in training must not dominate in use
ROWS_AT_ONCE = 4096
AXES = map_columns.AXES[:3]
MODEL = "population"

_MM = np.asarray(surface.ELECTRODE_MM)
#: For each electrode (19,), the index of its mirror image.
MIRROR: npt.NDArray[np.intp] = (
    ((_MM[:, None] * [1.0, -1.0, 1.0] - _MM[None]) ** 2).sum(axis=2).argmin(axis=1).astype(np.intp)
)


@dataclass(frozen=True)
class Sums:
    """Means over rows and drift: ``gram`` (323, 323), ``cross`` (323, 3) with force in N, ``mean`` (323,)."""

    gram: Floats
    cross: Floats
    mean: Floats


@dataclass(frozen=True)
class FingerSums:
    """Sums of one finger, and of its mirror image."""

    own: Sums
    mirrored: Sums


@dataclass(frozen=True)
class Population:
    """A population map: ``coefficients`` (323, 3) of columns(), in N.

    ``variance`` (323,) is that of the columns in training, with a floor.
    """

    coefficients: Floats
    variance: Floats

    def force(self, counts: Floats, tare: Floats) -> Floats:
        """Force (n, 3) in N on the finger, from counts (n, 19) and their ``tare`` (19,)."""
        return by_columns(counts, tare, lambda z: z @ self.coefficients)

    def wrench_map(self, tare: Floats) -> WrenchMap:
        """The same map in the form of a calibrated finger's, for ``tare`` (19,), with an offset of 0."""
        every = np.zeros((ALL_COLUMNS + 1, len(AXES)))
        every[_STACKED] = self.coefficients
        return WrenchMap(MODEL, AXES, np.asarray(tare, dtype=np.float64), 1, (0, 0, 0), every)


def columns(e: Floats, tare: Floats) -> Floats:
    """The columns (n, 323) that the map is linear in, from counts above the tare ``e`` (n, 19) and ``tare`` (19,)."""
    return features.columns(Signals(e, tare))[:, _STACKED]


def by_columns(counts: Floats, tare: Floats, of: Callable[[Floats], Floats]) -> Floats:
    """``of`` applied to the columns (n, 323) of counts (n, 19), in chunks of rows that fit the cache."""
    rows = range(0, len(counts), ROWS_AT_ONCE)
    return np.concatenate([of(columns(counts[at : at + ROWS_AT_ONCE] - tare, tare)) for at in rows])


def mirrored(run: Run) -> Run:
    """The finger's mirror image under the mirrored load."""
    truth = run.truth * [1.0, -1.0, 1.0]
    return replace(run, counts=run.counts[:, MIRROR], tare=run.tare[MIRROR], drift=run.drift[MIRROR], truth=truth)


def aligned(run: Run) -> Run:
    """The run without PDC, its truth shifted to the counts' time: the lag is between two loggers, not in the finger.

    Raises RecordingError when force and counts do not belong together.
    """
    lag, _ = (0, 0.0) if run.by_clocks else Lags(run, Blocks(run.rest, run.contact)).check()
    rows = np.arange(max(-lag, 0), len(run.truth) - max(lag, 0))
    contact = None if run.contact is None else run.contact[rows]
    counts, truth = run.counts[rows + lag], run.truth[rows, :3]
    return replace(run, counts=counts, truth=truth, rest=run.rest[rows], contact=contact, pdc=None)


def sums_of(run: Run) -> FingerSums:
    """What training needs from an aligned run, without the share of F_z in F_x."""
    truth = run.truth.copy()
    truth[:, 0] -= truth[:, 0].sum() / truth[:, 2].sum() * truth[:, 2]
    level = replace(run, truth=truth)
    return FingerSums(sums(level), sums(mirrored(level)))


def sums(run: Run) -> Sums:
    """Sums over the run's counts and force, averaged over the three drifts of moments.py."""
    gram = np.zeros((COLUMNS, COLUMNS))
    cross = np.zeros((COLUMNS, len(AXES)))
    mean = np.zeros(COLUMNS)
    for at, weight in DRIFT_NODES:
        drift = at * DRIFT_SIGMA_COUNTS * run.drift
        for start in range(0, len(run.counts), ROWS_AT_ONCE):
            rows = slice(start, start + ROWS_AT_ONCE)
            z = columns(run.counts[rows] - run.tare + drift, run.tare)
            gram += weight * (z.T @ z)
            cross += weight * (z.T @ run.truth[rows])
            mean += weight * z.sum(axis=0)
    n = len(run.counts)
    return Sums(gram / n, cross / n, mean / n)


def train(fingers: Sequence[FingerSums], *, symmetric: bool = False, mirror: bool = True) -> Population:
    """The map of several fingers, all with equal weight. With ``symmetric``, F_y too is trained on mirror images.

    ``mirror`` False trains on the fingers alone, for judging a map on their mirror images.
    """
    own = [finger.own for finger in fingers]
    every = [*own, *[finger.mirrored for finger in fingers]] if mirror else own
    even, variance = _solve(every)
    if not symmetric:
        even = even.copy()
        even[:, 1] = _solve(own)[0][:, 1]
    return Population(even, variance)


def _solve(of: Sequence[Sums]) -> tuple[Floats, Floats]:
    gram, cross, mean = (np.mean([getattr(one, name) for one in of], axis=0) for name in ("gram", "cross", "mean"))
    found, variance = np.zeros_like(cross), np.zeros(COLUMNS)
    for part in _PARTS:
        its = np.diag(gram)[part] - mean[part] ** 2
        variance[part] = np.maximum(its, VARIANCE_FLOOR * np.median(its))
        penalty = RIDGE * np.diag(variance[part])
        found[part] = np.linalg.solve(gram[np.ix_(part, part)] + penalty, cross[part]) / len(_PARTS)
    return found, variance
