"""The normal at the point of contact, corrected with contacts of a flat plate of recorded normal.

The correction to the formula's normal is a ridge regression on that normal and the electrodes' pattern: 69 numbers.
Frames of one contact are one look at the finger, so every choice and every verdict is held out by whole contacts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from biotac import InputError
from biotac.calibrate.wrench import angles_deg
from biotac.core import geometry as surface

Floats = npt.NDArray[np.float64]

RIDGES = (0.01, 0.1, 1.0)  # of each input's variance
VARIANCE_FLOOR = 1e-9
LEAST_CONTACTS = 8

Contacts = npt.NDArray[np.int64]


@dataclass(frozen=True)
class Normal:
    """A correction that is added to the formula's normal.

    ``coefficients`` (23, 3) are for the formula's normal (3 rows), the pattern (19) and a constant.
    """

    coefficients: Floats

    def corrected(self, points_mm: Floats, e: Floats) -> Floats:
        """Unit normals (n, 3) from published points (n, 3) and counts above the tare (n, 19); NaN without a point."""
        formula, inputs = _inputs(points_mm, e)
        return _unit(formula + inputs @ self.coefficients[:-1] + self.coefficients[-1])

    def point_mm(self, points_mm: Floats, e: Floats) -> Floats:
        """Points (n, 3) in mm where the core has the corrected normal. On the cylinder a point only turns; x stays."""
        normal = self.corrected(points_mm, e)
        x = points_mm[:, 0]
        normal[:, 0] = np.where(x > 0.0, np.maximum(normal[:, 0], 0.0), 0.0)
        result: Floats = surface.RADIUS_MM * _unit(normal)
        result[:, 0] = np.where(x > 0.0, result[:, 0], x)
        return result


@dataclass(frozen=True)
class Looks:
    """n frames of a plate on the finger: published ``points_mm`` (n, 3) and counts above the tare ``e`` (n, 19).

    ``normals`` (n, 3) are the plate's unit normals, outward from the finger; ``contact`` (n,) is each frame's contact.
    """

    points_mm: Floats
    e: Floats
    normals: Floats
    contact: Contacts


def fit(looks: Looks) -> Normal:
    """The correction, with the ridge that is best on held-out contacts. Raises InputError for too few contacts."""
    return Normal(_Fitting(looks).all_but(None))


def held_out(looks: Looks) -> Floats:
    """Normals (n, 3) of each contact by fit() to the others, ridge included. Raises InputError for too few contacts."""
    fitting = _Fitting(looks)
    result = np.empty_like(looks.normals)
    for k, rows in enumerate(fitting.rows):
        result[rows] = fitting.predicted(rows, fitting.all_but(k))
    return result


class _Fitting:
    """Sums for every contact, so that a fit to any choice of contacts is one solve for 22 unknowns."""

    def __init__(self, looks: Looks) -> None:
        names, contact_of = np.unique(looks.contact, return_inverse=True)
        if len(names) < LEAST_CONTACTS:
            raise InputError(
                f"{len(names)} contacts with the plate: expected {LEAST_CONTACTS} or more; press it from many sides"
            )
        self.rows = [np.flatnonzero(contact_of == k) for k in range(len(names))]
        self._normals = looks.normals
        self._formula, inputs = _inputs(looks.points_mm, looks.e)
        self._z = np.column_stack([inputs, np.ones(len(inputs))])
        left = looks.normals - self._formula
        self._gram = np.array([self._z[rows].T @ self._z[rows] for rows in self.rows])
        self._cross = np.array([self._z[rows].T @ left[rows] for rows in self.rows])

    def predicted(self, rows: npt.NDArray[np.intp], coefficients: Floats) -> Floats:
        """Unit normals of ``rows``."""
        return _unit(self._formula[rows] + self._z[rows] @ coefficients)

    def all_but(self, out: int | None) -> Floats:
        """Coefficients (23, 3) fitted without contact ``out``; their ridge is chosen without it, too."""
        kept = [k for k in range(len(self.rows)) if k != out]
        errors = []
        for ridge in RIDGES:
            predicted = [self.predicted(self.rows[k], self._solved([j for j in kept if j != k], ridge)) for k in kept]
            truth = [self._normals[self.rows[k]] for k in kept]
            errors.append(np.median(angles_deg(np.concatenate(predicted), np.concatenate(truth))))
        return self._solved(kept, RIDGES[int(np.argmin(errors))])

    def _solved(self, contacts: list[int], ridge: float) -> Floats:
        gram, cross = self._gram[contacts].sum(axis=0), self._cross[contacts].sum(axis=0)
        n = gram[-1, -1]
        mean = gram[-1, :-1] / n
        about_mean = gram[:-1, :-1] / n - mean[:, None] * mean
        # if nothing touched the tip, all normals lie in a plane: a column that does not vary must get no weight
        pull = ridge * np.maximum(np.diag(about_mean), VARIANCE_FLOOR)
        slope = np.linalg.solve(about_mean + np.diag(pull), cross[:-1] / n - mean[:, None] * (cross[-1] / n))
        return np.vstack([slope, cross[-1] / n - mean @ slope])


def _inputs(points_mm: Floats, e: Floats) -> tuple[Floats, Floats]:
    """The formula's normals (n, 3), and the regression's inputs (n, 22): these and the counts as a unit vector."""
    known = np.isfinite(points_mm).all(axis=1, keepdims=True)
    formula = np.where(known, surface.normals_at(np.where(known, points_mm, [0.0, 0.0, -1.0])), np.nan)
    return formula, np.column_stack([formula, _unit(e)])


def _unit(vectors: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return vectors / np.where(length > 0.0, length, 1.0)
