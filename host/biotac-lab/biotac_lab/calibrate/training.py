"""The population map: a ridge fit over drift and mirrored fingers.

Columns have no offset and are 0 where counts are at their tare, so that rest is 0 N on any finger. A finger's mirror
image (left and right electrodes exchanged, F_y negated) is another possible finger, and the map is trained on it too;
for F_y only when asked, as fingers of one rig share the same asymmetry. A plate is never quite parallel to the finger:
the share of F_z in F_x over a whole recording comes from the mounting and from habit, and is removed before training.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from biotac.calibrate.population import (
    AXES,
    COLUMNS,
    ROWS_AT_ONCE,
    Population,
    Sums,
    columns,
    light_gain,
    normals,
)
from biotac.calibrate.wrench import DRIFT_NODES, Blocks, Lags, Run
from biotac.core import geometry as surface

Floats = npt.NDArray[np.float64]

DRIFT_SIGMA_COUNTS = 100.0  # a finger's drift in about two minutes of warm-up
# x, y, z; of each column's variance. It pulls to the normals, as data of one rig do not know better.
RIDGE = (5e-4, 1e-2, 1e-3)
RELATIVE_N = 1.0  # a row weighs 1 / (force + this), between errors in newtons and errors as shares of the force
VARIANCE_FLOOR = 0.02  # of the median: a column that hardly varies in training must not dominate in use

_MM = np.asarray(surface.ELECTRODE_MM)
ELECTRODES = len(_MM)
#: For each electrode (19,), the index of the mirror image.
MIRROR: npt.NDArray[np.intp] = (
    ((_MM[:, None] * [1.0, -1.0, 1.0] - _MM[None]) ** 2).sum(axis=2).argmin(axis=1).astype(np.intp)
)


@dataclass(frozen=True)
class FingerSums:
    """Sums of one finger, and of the mirror image."""

    own: Sums
    mirrored: Sums


def mirrored(run: Run) -> Run:
    """The finger's mirror image under the mirrored load."""
    truth = run.truth * [1.0, -1.0, 1.0]
    return replace(run, counts=run.counts[:, MIRROR], tare=run.tare[MIRROR], drift=run.drift[MIRROR], truth=truth)


def aligned(run: Run) -> Run:
    """The run without PDC, the truth shifted to the counts' time: the lag is between two loggers, not in the finger.

    Raises RecordingError when force and counts do not belong together.
    """
    lag, _ = (0, 0.0) if run.by_clocks else Lags(run, Blocks(run.rest, run.contact)).check()
    rows = np.arange(max(-lag, 0), len(run.truth) - max(lag, 0))
    contact = None if run.contact is None else run.contact[rows]
    counts, truth = run.counts[rows + lag], run.truth[rows, :3]
    return replace(run, counts=counts, truth=truth, rest=run.rest[rows], contact=contact, pdc=None)


def sums_of(run: Run) -> FingerSums:
    """The sums for training from an aligned run, without the share of F_z in F_x."""
    truth = run.truth.copy()
    truth[:, 0] -= truth[:, 0].sum() / truth[:, 2].sum() * truth[:, 2]
    level = replace(run, truth=truth)
    return FingerSums(sums(level), sums(mirrored(level)))


def sums(run: Run) -> Sums:
    """Weighted means over the run's rows, averaged over three drifts."""
    weight = 1.0 / (np.linalg.norm(run.truth, axis=1) + RELATIVE_N)
    weight /= weight.sum()
    gram = np.zeros((COLUMNS, COLUMNS))
    cross = np.zeros((COLUMNS, len(AXES)))
    mean = np.zeros(COLUMNS)
    for at, share in DRIFT_NODES:
        drift = at * DRIFT_SIGMA_COUNTS * run.drift
        for start in range(0, len(run.counts), ROWS_AT_ONCE):
            rows = slice(start, start + ROWS_AT_ONCE)
            e = run.counts[rows] - run.tare + drift
            z = light_gain(e)[:, None] * columns(e, run.tare)
            weighted = (share * weight[rows, None] * z).T
            gram += weighted @ z
            cross += weighted @ run.truth[rows]
            mean += weighted.sum(axis=1)
    return Sums(gram, cross, mean)


def train(fingers: Sequence[FingerSums], *, symmetric: bool = False, mirror: bool = True) -> Population:
    """The map of several fingers, all with equal weight. With ``symmetric``, F_y too is trained on mirror images.

    ``mirror`` False trains on the fingers alone, to test a map on their mirror images.
    """
    own = [finger.own for finger in fingers]
    every = [*own, *[finger.mirrored for finger in fingers]] if mirror else own
    even, variance = _solve(every)
    if not symmetric:
        even = even.copy()
        even[:, 1] = _solve(own)[0][:, 1]
    return Population(even, variance)


def of_others(fingers: Sequence[FingerSums], *, symmetric: bool = False) -> list[Population]:
    """For each finger the map of the others."""
    return [train([other for other in fingers if other is not finger], symmetric=symmetric) for finger in fingers]


def _solve(fingers: Sequence[Sums]) -> tuple[Floats, Floats]:
    gram, cross, mean = (np.mean([getattr(f, name) for f in fingers], axis=0) for name in ("gram", "cross", "mean"))
    known = normals()
    spread = np.diag(gram) - mean**2
    variance = np.maximum(spread, VARIANCE_FLOOR * np.median(spread))
    left = cross - gram @ known
    found = [np.linalg.solve(gram + ridge * np.diag(variance), left[:, axis]) for axis, ridge in enumerate(RIDGE)]
    return known + np.column_stack(found), variance
