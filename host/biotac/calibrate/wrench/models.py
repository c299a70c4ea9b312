"""The models, all linear in their coefficients, solved from sums alone.

Ridge shrinks toward Lin's geometry and not toward zero: a coefficient the run says nothing about
stays what the electrode's place on the finger makes it, and a hopeless run ends as Lin's three scales.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from ...core import geometry as surface
from ...core.geometry import Floats
from . import features
from .features import Family

LAMBDAS: Floats = np.logspace(-6, 1, 8)  # per row, in units of each column's own variance
# A column that is constant in training has no variance to be measured in: without a floor it is free,
# and a test row that moves it goes anywhere (the hinge model of biotac.md 5: R2 -34).
COLUMN_FLOOR = 0.01


@dataclass(frozen=True)
class Model:
    """``how``: Lin's scales alone, scales and offsets, or every coefficient with ridge."""

    name: str
    family: Family
    how: Literal["scales", "scales-offset", "ridge"]
    words: str


MODELS = (
    Model("lin-scales", features.LINEAR, "scales", "Lin's sums, one scale an axis"),
    Model("lin-scales-offset", features.LINEAR, "scales-offset", "the same, with an offset an axis"),
    Model("affine", features.LINEAR, "ridge", "every electrode to every axis"),
    Model("sign-split", features.SIGN_SPLIT, "ridge", "compression and bulge apart"),
    Model("gated-sign-split", features.GATED, "ridge", "sign-split, gains following the contact, PDC where recorded"),
    Model("gated-twice", features.GATED_TWICE, "ridge", "the same, gains quadratic in the contact's place"),
    Model("quadratic", features.QUADRATIC, "ridge", "all products of two electrodes, PDC where recorded"),
    Model("conductance-quadratic", features.CONDUCTANCE_QUADRATIC, "ridge", "all products of two conductances, PDC"),
    Model("joined", features.JOINED, "ridge", "gated-twice and conductance-quadratic in one"),
)
LIN, AFFINE, GATED = MODELS[0], MODELS[2], MODELS[4]

# Which of the three is best changes from axis to axis and from block to block by less than what their mean gains.
POOLED = "pooled"
POOLED_WORDS = "mean of gated-sign-split, quadratic and conductance-quadratic"
TEMPLATE = "template"
TEMPLATE_WORDS = "five shapes around the contact, a 5x5 solve a frame; host only, for comparison"
POOL = ("gated-sign-split", "quadratic", "conductance-quadratic")


def lin_directions(axes: int) -> Floats:
    """Lin's Eq 3 and 4: what a count on each electrode (19, axes) is in [1] and, beyond three, in mm.

    The seventh is Eq 4 about the middle of the pad and its outward normal, -z: torsion as long as the contact is there.
    """
    arms = np.cross(surface.ELECTRODE_MM, surface.ELECTRODE_NORMAL)
    middle = surface.ELECTRODE_MM.mean(axis=0)
    torsion = -np.cross(surface.ELECTRODE_MM - middle, surface.ELECTRODE_NORMAL)[:, 2:]
    return np.concatenate([surface.ELECTRODE_NORMAL, arms, torsion], axis=1)[:, :axes]


def used(model: Model, size: int, axes: int) -> npt.NDArray[np.intp]:
    """Rows of the sums (of ``size``) that the model is about: its columns, the offset, the truth."""
    columns = size - axes - 1
    return np.concatenate([model.family.index(columns), np.arange(columns, size)])


def solve(model: Model, sums: Floats, axes: int, tare: Floats) -> Floats:
    """Coefficients (k, p + 1, axes), the offset last, from the training strips' Z'Z of used() rows.

    k is 1 for Lin's scales and one per entry of LAMBDAS for ridge.
    """
    q = len(sums) - axes
    gram, cross = sums[:q, :q], sums[:q, q:]
    lin = _lin(model, gram, cross, tare)
    if model.how != "ridge":
        return lin[None]
    rows = gram[-1, -1]
    variance = np.diag(gram) / rows - (gram[-1] / rows) ** 2
    variance = np.maximum(variance, COLUMN_FLOOR * np.median(variance[:-1]))
    variance[-1] = 0.0  # the offset is free
    penalty = LAMBDAS[:, None, None] * np.diag(variance * rows)
    left = np.broadcast_to(cross - gram @ lin, (len(LAMBDAS), q, axes))
    found: Floats = lin + np.linalg.solve(gram + penalty, left)
    return found


def _lin(model: Model, gram: Floats, cross: Floats, tare: Floats) -> Floats:
    """Lin's scales, least squares per axis, written in the family's columns (p + 1, axes)."""
    columns, axes = len(gram) - 1, cross.shape[1]
    directions = np.zeros((columns + 1, axes))
    directions[:-1] = model.family.unit(tare, columns) @ lin_directions(axes)
    result = np.zeros((columns + 1, axes))
    for axis in range(axes):
        basis = np.zeros((columns + 1, 1 if model.how == "scales" else 2))
        basis[:, 0] = directions[:, axis]
        if model.how != "scales":
            basis[-1, 1] = 1.0
        small = basis.T @ gram @ basis
        # M_x is the difference of two electrodes: where nothing reaches them its sum is 0 / 0
        small[0, 0] += 1e-9 * max(float(small.max()), 1.0)
        result[:, axis] = basis @ np.linalg.solve(small, basis.T @ cross[:, axis])
    return result


def squared_errors(coefficients: Floats, sums: Floats, axes: int) -> Floats:
    """Sum of squared errors (k, axes) of coefficients (k, p + 1, axes) over the rows in ``sums``."""
    q = len(sums) - axes
    gram, cross = sums[:q, :q], sums[:q, q:]
    truth = np.diag(sums)[q:]
    fitted = (coefficients * (gram @ coefficients - 2.0 * cross)).sum(axis=1)
    # cancellation may leave a perfect fit a hair below zero
    floored: Floats = np.maximum(truth + fitted, 0.0)
    return floored


def truth_variance(sums: Floats, axes: int) -> Floats:
    """Variance (axes,) of the truth over the rows in ``sums``."""
    q = len(sums) - axes
    rows = sums[q - 1, q - 1]
    variance: Floats = np.diag(sums)[q:] / rows - (sums[q - 1, q:] / rows) ** 2
    return variance
