"""Force from neural nets (Wettels and Loeb 2011, II.D): one for all, or one for each class of probe and place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from biotac import InputError

from . import inputs, nets
from .nets import Floats

Integers = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]

FORWARD_D_MM = 14.0  # the paper, II.D3: "near d = 14 mm the BioTac begins to curve and taper"
CLASSES = ("rear, small", "rear, large", "forward, small", "forward, large")
STOPPING_SHARE = 0.15


def classes(d_mm: Floats, large: Bools) -> Integers:
    """Index into CLASSES (n,): ``d_mm`` is that of the PAF, ``large`` is true for the 10 mm or the flat probe."""
    return 2 * (np.asarray(d_mm) >= FORWARD_D_MM).astype(np.int64) + np.asarray(large).astype(np.int64)


@dataclass(frozen=True)
class ForceNets:
    """Nets by class: ``by_class[c]`` holds one net for all axes, or one for each axis."""

    by_class: dict[int, list[nets.Net]]

    def __call__(self, above: Floats, kind: Integers | None = None) -> Floats:
        """Force (n, 3) in N from signals (n, 19); ``kind`` (n,) is each row's class, 0 for all if not given.

        Raises InputError for a class that no net was trained for.
        """
        labels = np.zeros(len(above), np.int64) if kind is None else np.asarray(kind)
        unknown = sorted(set(labels.tolist()) - set(self.by_class))
        if unknown:
            raise InputError(
                f"class {unknown[0]} has no net: expected one of {sorted(self.by_class)}; train one for it"
            )
        result = np.empty((len(above), 3))
        for c, parts in self.by_class.items():
            rows = labels == c
            if rows.any():
                result[rows] = np.hstack([net(above[rows]) for net in parts])
        return result


def train(
    above: Floats,
    force_n: Floats,
    groups: Integers,
    kind: Integers | None = None,
    *,
    reduce: inputs.Reduce = inputs.principal,
    by_spearman: bool = False,
    seed: int = 0,
    steps: int = nets.STEPS,
) -> ForceNets:
    """Train nets from signals (n, 19) to force (n, 3) in N.

    Rows of one of the ``groups`` (n,), e.g. a contact or a block, are all used for training or all for early stopping.
    With ``kind`` (n,) each class has a separate net. With ``by_spearman`` each axis has one, fed with the
    electrodes that correlate with that axis.
    """
    labels = np.zeros(len(above), np.int64) if kind is None else np.asarray(kind)
    made: dict[int, list[nets.Net]] = {}
    for c in np.unique(labels).tolist():
        x, f, names = above[labels == c], force_n[labels == c], groups[labels == c]
        if by_spearman:
            kept = inputs.correlated(x, f)
            kept[:, ~kept.any(axis=0)] = True  # an axis that no electrode correlates with gets all of them
            parts = [(inputs.only(x, kept[:, axis]), f[:, [axis]]) for axis in range(3)]
        else:
            parts = [(reduce(x), f)]
        stopping = _aside(names, seed)
        made[c] = [_net(reduction, x, target, stopping, seed, steps) for reduction, target in parts]
    return ForceNets(made)


def _net(
    reduction: inputs.Reduction, above: Floats, target: Floats, stopping: Bools, seed: int, steps: int
) -> nets.Net:
    x = reduction(above)
    aside = (x[stopping], target[stopping]) if stopping.any() else None
    return nets.train(x[~stopping], target[~stopping], aside, seed=seed, steps=steps).after(reduction)


def _aside(groups: Integers, seed: int) -> Bools:
    """Mask of the rows for early stopping: STOPPING_SHARE of the groups, rounded down; fewer than 7 give none."""
    names = np.random.default_rng([seed, 9]).permutation(np.unique(groups))
    return np.isin(groups, names[: int(len(names) * STOPPING_SHARE)])


def cross_validated(above: Floats, groups: Integers, folds: int, predict: Callable[[Bools, Bools], Floats]) -> Floats:
    """Held-out predictions (n, 3) by ``predict(training, test)``, masks (n,), in each of ``folds``.

    No group is both in training and in test.
    """
    from sklearn.model_selection import GroupKFold

    estimates = np.full((len(above), 3), np.nan)
    for training, test in GroupKFold(folds).split(above, groups=groups):
        masks = [np.isin(np.arange(len(above)), part) for part in (training, test)]
        estimates[masks[1]] = predict(*masks)
    return estimates
