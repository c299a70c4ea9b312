"""Radius of curvature as one of four classes: seed 000, II.B, by frames as there, and by loading trajectories.

The paper's perceptron is train(); machine() is of today, and better.

A frame's electrodes name their place first, and a net that has not seen the place is lost: held out by contact, frames
do badly on the emulated finger (host/docs/features.md has the figures). What a contact looks like from its own middle
depends on the place far less, and how that grows with the load says more than any frame: so shape() and trajectories().
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..wire import sensor_gen as _sensor
from . import inputs, levenberg
from .signals import ELECTRODE_DR_MM, Floats

if TYPE_CHECKING:
    from sklearn.pipeline import Pipeline

Integers = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

SHARES = (0.70, 0.15, 0.15)  # seed 000: training, stopping, test
LEVELS = (0.15, 0.5, 1.0)  # of a press's own largest signal
COMPONENTS = 20  # the net has twice as many units, as the paper's with its 19 electrodes
LOG_RANGE = (-1.0, 6.0)  # a bulge's, and that of an electrode whose counts ran out
STRONGEST, WEAKEST = 8, 3


def log_change(above: Floats, tare: Floats) -> Floats:
    """ln of resistance over that at rest (n, 19), > 0 where pressed, of counts ``above`` the ``tare``, both (n, 19)."""
    full = float(_sensor.FULL_SCALE_COUNT)

    def log_ohm(counts: Floats) -> Floats:
        held = np.clip(counts, 1.0, full - 1.0)
        result: Floats = np.log(full / held - 1.0)
        return result

    return np.clip(log_ohm(above + tare) - log_ohm(tare), *LOG_RANGE)


def shape(above: Floats, tare: Floats) -> Floats:
    """A frame's contact from its own middle: (n, 17).

    Of log_change() where pressed: the middle (d, r) in mm, the log of the sum, the second moments about the middle in
    mm^2 (dd, rr, dr), the eight strongest electrodes in order, and of all the three lowest, which tell a bulge.
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
    """shape() of each press at LEVELS of its own largest signal on its way up, (presses, 51), and each one's number.

    ``press`` (n,) numbers the rows; those of a press stand together, in order. A press that jumps over a level is read
    at the first row beyond it. No force is needed.
    """
    rows = shape(above, tare)
    size = np.exp(rows[:, 2])
    starts = np.flatnonzero(np.r_[True, press[1:] != press[:-1]])
    if len(np.unique(press)) != len(starts):
        raise InputError("rows of a press do not stand together: expected them in order; sort by press and time")
    found = []
    for start, end in zip(starts, [*starts[1:], len(press)], strict=True):
        grown = np.maximum.accumulate(size[start:end])
        at = start + np.searchsorted(grown, np.array(LEVELS) * grown[-1])
        found.append(rows[at].ravel())
    return np.array(found), press[starts]


def split(groups: npt.NDArray[np.generic], seed: int = 0) -> tuple[Bools, Bools, Bools]:
    """Rows (n,) for training, stopping and test by SHARES, each of the ``groups`` (n,) whole on one side."""
    names = np.random.default_rng([seed, 8]).permutation(np.unique(groups))
    ends = np.rint(np.cumsum(SHARES) * len(names)).astype(int)[:-1]
    training, stopping, test = (np.isin(groups, part) for part in np.split(names, ends))
    return training, stopping, test


@dataclass(frozen=True)
class Classifier:
    """A net behind its reduction; ``classes`` outputs."""

    reduction: inputs.Reduction
    net: levenberg.Net

    def outputs(self, columns: Floats) -> Floats:
        """(n, classes), about 1 for the class it is and 0 for others; not probabilities."""
        return self.net(self.reduction(columns))

    def __call__(self, columns: Floats, together: npt.NDArray[np.generic] | None = None) -> Integers:
        """The class (n,) of each row; see decide()."""
        return decide(self.outputs(columns), together)


def decide(outputs: Floats, together: npt.NDArray[np.generic] | None = None) -> Integers:
    """The class (n,) of each row of ``outputs`` (n, classes), the largest; rows of one number in ``together`` (n,) are
    decided by their mean output.
    """
    if together is not None:
        _, of = np.unique(together, return_inverse=True)
        sums = np.zeros((of.max() + 1, outputs.shape[1]))
        np.add.at(sums, of, outputs)
        outputs = sums[of]
    result: Integers = outputs.argmax(axis=1)
    return result


def train(
    columns: Floats, kind: Integers, training: Bools, stopping: Bools, *, seed: int = 0, steps: int = levenberg.STEPS
) -> Classifier:
    """Of ``columns`` (n, d), those of frames or of trajectories, and the class ``kind`` (n,) of each, 0 and up.

    More than COMPONENTS columns are reduced to as many principal components.
    """
    targets = np.eye(int(kind.max()) + 1)[kind]
    wide = columns.shape[1] > COMPONENTS
    known = columns[training]
    reduction = inputs.principal(known, 0.0, COMPONENTS) if wide else inputs.every(known)
    x = reduction(columns)
    aside = (x[stopping], targets[stopping])
    return Classifier(reduction, levenberg.train(x[training], targets[training], aside, seed=seed, steps=steps))


def machine(**options: Any) -> Pipeline:
    """A support vector machine with a radial kernel on scaled columns, to be fitted: ``fit(columns, kind)``; its
    ``decision_function(columns)`` goes to decide(). ``options`` are those of sklearn's SVC.
    """
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler
    from sklearn.svm import SVC

    return make_pipeline(StandardScaler(), SVC(**{"C": 10.0, **options}))


def confusion(said: Integers, truth: Integers, classes: int) -> Integers:
    """How often each class (row: said) was each (column: true), (classes, classes): seed 000's figure 7."""
    table = np.zeros((classes, classes), np.int64)
    np.add.at(table, (said, truth), 1)
    return table
