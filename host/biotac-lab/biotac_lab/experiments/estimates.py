"""Force and torque of a trial by the paper's scales on the board, and by fitted wrench maps.

Lin 2013 has one scale per axis, found "through direct experimentation". Here it is a least-squares fit without offset
of the board's own signals to the truth. It is written into the board's settings, so that the comparison uses published
results of that board. Mx has no scale on the board, as the electrodes hardly see it: there the board publishes the
lever of the force.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from biotac import InputError, Setting
from biotac.core import geometry as surface
from biotac.map import WrenchMap, load_fitted
from biotac.wire import messages

from ..gains import fit_gains
from .trial import Bools, Floats, Settings, Trial

PAPER = "paper"


@dataclass(frozen=True)
class Estimate:
    """A model's estimate of a trial: ``force_n`` (n, 3), ``torque_nmm`` (n, 3) about the origin or None.

    ``own_torsion_nmm`` (n,) is from a map that was fitted to torsion itself.
    """

    name: str
    force_n: Floats
    torque_nmm: Floats | None
    own_torsion_nmm: Floats | None = None

    def torsion_nmm(self, at_mm: Floats) -> Floats | None:
        """Torque (n,) about the outward normal at contacts (n, 3), the map's or (M - c x F) . n; NaN if untouched."""
        if self.own_torsion_nmm is not None:
            return np.where(np.isfinite(at_mm).all(axis=1), self.own_torsion_nmm, np.nan)
        if self.torque_nmm is None:
            return None
        return torsion(self.force_n, self.torque_nmm, at_mm)


def torsion(force_n: Floats, torque_nmm: Floats, at_mm: Floats) -> Floats:
    """Torque (n,) about the outward normal at ``at_mm`` (n, 3), from a wrench about the origin."""
    known = np.asarray(np.isfinite(at_mm).all(axis=1))
    normal = surface.normals_at(np.where(known[:, None], at_mm, [0.0, 0.0, -1.0]))
    about: Floats = ((torque_nmm - np.cross(at_mm, force_n)) * normal).sum(axis=1)
    return np.where(known, about, np.nan)


def paper_scales(trials: Sequence[Trial]) -> Settings:
    """The paper's scales as board settings: least squares over all frames of ``trials`` with a tare."""
    parts: list[tuple[Floats, Floats, Floats]] = []
    for trial in trials:
        torque = np.nan_to_num(trial.torque_nmm)  # zero where there is none
        known = np.asarray(np.isfinite(trial.signal).all(axis=1))
        parts.append((trial.signal[known], trial.force_n[known], torque[known]))
    signal, force, torque = (np.concatenate(column) for column in zip(*parts, strict=True))
    return {Setting[name.upper()]: value for name, value in fit_gains(signal, force, torque).items()}


def by_paper(trial: Trial, settings: Settings, name: str = PAPER) -> Estimate:
    """The published estimate of a board with these scales."""
    frames = trial.again(settings).frames
    return Estimate(name, frames["force_n"], frames["torque_nmm"])


def by_map(trial: Trial, fitted: WrenchMap, name: str) -> Estimate:
    """A fitted map on the trial's counts, with the board's tare of each frame in place of the map's own.

    Raises InputError when the map needs PDC and the trial has none.
    """
    if fitted.with_pdc and not np.isfinite(trial.pressure).any():
        raise InputError(f"map {name} needs PDC, but {trial.name} has none; choose a map trained without PDC")
    counts = np.where(trial.counts == messages.INVALID_COUNT, np.nan, trial.counts)
    wrench = replace(fitted, tare=trial.tare).predict(counts, trial.pressure)
    columns = {axis: k for k, axis in enumerate(fitted.axes)}
    force = wrench[:, [columns[axis] for axis in ("Fx", "Fy", "Fz")]]
    torque = wrench[:, [columns[axis] for axis in ("Mx", "My", "Mz")]] if "Mz" in columns else None
    own = wrench[:, columns["torsion"]] if "torsion" in columns else None
    return Estimate(name, force, torque, own)


def load_maps(paths: Sequence[Path]) -> dict[str, tuple[Path, WrenchMap]]:
    """Maps and their paths, by file name without endings. Raises InputError."""
    maps: dict[str, tuple[Path, WrenchMap]] = {}
    for path in paths:
        name = path.name.removesuffix(".json").removesuffix(".wrench")
        if name in maps or name.startswith(PAPER):
            raise InputError(
                f"{path}: map name {name} is taken, or begins with 'paper' like the built-in models; rename the file"
            )
        maps[name] = path, load_fitted(path)
    return maps


def rmse(estimate: Floats | None, truth: Floats | None, rows: Bools) -> Floats:
    """RMS error per column over ``rows`` where both are known; NaN if there are none."""
    if estimate is None or truth is None:
        return np.full(3, np.nan)
    a, b = np.atleast_2d(estimate.T)[:, rows], np.atleast_2d(truth.T)[:, rows]
    known = np.isfinite(a) & np.isfinite(b)
    squared = np.where(known, a - b, 0.0) ** 2
    with np.errstate(invalid="ignore"):
        result: Floats = np.sqrt(squared.sum(axis=1) / np.where(known.any(axis=1), known.sum(axis=1), np.nan))
    return result
