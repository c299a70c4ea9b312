"""Radius of curvature as one of four classes (Wettels and Loeb 2011, II.B), from frames as there, or from loadings.

The paper's perceptron is train(); machine() is a newer method, and better.

A frame's electrodes depend mostly on the place of contact, and a net fails at places that it has not seen: held out by
contact, frames do badly on the emulated finger (docs/learning.md). The shape of a contact about its middle depends far
less on the place, and how that shape grows with the load says more than any single frame. Hence shape() and
trajectories().
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from biotac import InputError
from biotac.wire import sensor
from biotac_lab.features.signals import ELECTRODE_DR_MM

from . import inputs, nets
from .nets import Floats

Integers = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

SHARES = (0.70, 0.15, 0.15)  # the paper's: training, stopping, test
LEVELS = (0.15, 0.5, 1.0)  # shares of a press's own largest signal
COMPONENTS = 20  # the net has twice as many units, as in the paper with 19 electrodes
LOG_RANGE = (-1.0, 6.0)  # from a bulge to an electrode at the end of its range
STRONGEST, WEAKEST = 8, 3


def log_change(above: Floats, tare: Floats) -> Floats:
    """ln of each electrode's resistance over that at rest (n, 19), > 0 where pressed, limited to LOG_RANGE.

    ``above`` (n, 19) are counts above the ``tare`` (n, 19).
    """
    full = float(sensor.FULL_SCALE_COUNT)

    def log_ohm(counts: Floats) -> Floats:
        held = np.clip(counts, 1.0, full - 1.0)
        return np.log(full / held - 1.0)

    return np.clip(log_ohm(above + tare) - log_ohm(tare), *LOG_RANGE)


def shape(above: Floats, tare: Floats) -> Floats:
    """Shape of each frame's contact about the middle (n, 17), from log_change().

    Over the pressed electrodes: the middle (d, r) in mm, the log of the sum, and the second moments about the middle in
    mm^2 (dd, rr, dr). Over all electrodes: the eight highest values in order, and the three lowest, which show a bulge.
    """
    change = log_change(above, tare)
    pressed = np.maximum(change, 0.0)
    total = pressed.sum(axis=1) + 1e-9
    d, r = ELECTRODE_DR_MM.T
    middle_d, middle_r = pressed @ d / total, pressed @ r / total
    moments = [
        pressed @ (d * d) / total - middle_d**2, pressed @ (r * r) / total - middle_r**2,
        pressed @ (d * r) / total - middle_d * middle_r,
    ]  # fmt: skip
    ordered = -np.sort(-change, axis=1)
    return np.column_stack([middle_d, middle_r, np.log(total), *moments, ordered[:, :STRONGEST], ordered[:, -WEAKEST:]])


def trajectories(above: Floats, tare: Floats, press: Integers) -> tuple[Floats, Integers]:
    """shape() of each press (presses, 51) at LEVELS of the largest signal while loading, and the press (presses,).

    ``press`` (n,) is each row's press; the rows of a press are consecutive and in order of time. A press that jumps
    over a level is read at the first row beyond it. No force is needed. Raises InputError if a press's rows are apart.
    """
    rows = shape(above, tare)
    size = np.exp(rows[:, 2])
    starts = np.flatnonzero(np.r_[True, press[1:] != press[:-1]])
    if len(np.unique(press)) != len(starts):
        raise InputError("rows of a press are not consecutive: expected them in time order; sort by press, then time")
    found = []
    for start, end in zip(starts, [*starts[1:], len(press)], strict=True):
        grown = np.maximum.accumulate(size[start:end])
        at = start + np.searchsorted(grown, np.array(LEVELS) * grown[-1])
        found.append(rows[at].ravel())
    return np.array(found), press[starts]


def split(groups: npt.NDArray[np.generic], seed: int = 0) -> tuple[Bools, Bools, Bools]:
    """Masks (n,) of the rows for training, stopping and test by SHARES; each of the ``groups`` (n,) is in one only."""
    names = np.random.default_rng([seed, 8]).permutation(np.unique(groups))
    ends = np.rint(np.cumsum(SHARES) * len(names)).astype(int)[:-1]
    training, stopping, test = (np.isin(groups, part) for part in np.split(names, ends))
    return training, stopping, test


def decide(outputs: Floats, together: npt.NDArray[np.generic] | None = None) -> Integers:
    """The class (n,) with the largest output in each row of ``outputs`` (n, classes).

    Rows with the same number in ``together`` (n,) are decided together, by the sum of their outputs.
    """
    if together is not None:
        _, group = np.unique(together, return_inverse=True)
        sums = np.zeros((group.max() + 1, outputs.shape[1]))
        np.add.at(sums, group, outputs)
        outputs = sums[group]
    result: Integers = outputs.argmax(axis=1)
    return result


def train(
    columns: Floats, kind: Integers, training: Bools, stopping: Bools, *, seed: int = 0, steps: int = nets.STEPS
) -> nets.Net:
    """Train on ``columns`` (n, d) of frames or trajectories and the class ``kind`` (n,) of each, from 0.

    ``training`` and ``stopping`` (n,) are masks of the rows. More than COMPONENTS columns are
    reduced to that many principal components. The net's outputs (n, classes) are about 1 for the right class and 0 for
    the others: not probabilities. decide() takes them.
    """
    targets = np.eye(int(kind.max()) + 1)[kind]
    wide = columns.shape[1] > COMPONENTS
    known = columns[training]
    reduction = inputs.principal(known, 0.0, COMPONENTS) if wide else inputs.every(known)
    x = reduction(columns)
    aside = (x[stopping], targets[stopping])
    return nets.train(x[training], targets[training], aside, seed=seed, steps=steps).after(reduction)


def machine() -> Any:
    """An unfitted support vector machine with a radial kernel on scaled columns.

    Fit it with ``fit(columns, kind)``; decide() wants ``decision_function(columns)``.
    """
    from sklearn.pipeline import make_pipeline  # half a second to import
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC

    return make_pipeline(StandardScaler(), SVC(C=10.0))
