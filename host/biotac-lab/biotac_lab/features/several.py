"""Several contacts at once, which Wettels and Loeb 2011 leave to others: clusters on a graph of electrodes.

Electrodes are neighbours when they are at most REACH_MM apart on the skin laid flat. Each pressed electrode belongs to
the summit that it climbs to, step by step to the strongest neighbour. Two summits are one contact when the pass between
them is above PASS_SHARE of the lower summit. The electrodes are 4 to 7 mm apart: two contacts that share a summit are
reported as one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from biotac.core import geometry as surface
from biotac.kernels.geometry import Floats

from .paf import electrode_force
from .signals import ELECTRODE_DR_MM, ELECTRODES

REACH_MM = 5.5
PASS_SHARE = 0.5  # of the lower summit
# An electrode's signal depends more on the distance of the contact than on the force: this pulls towards equal shares.
SHARE_POWER = 1.0 / 3.0
LEAST_SHARE = 0.1  # of the strongest electrode: below it are noise and the bulge between two contacts


_BETWEEN_MM = np.linalg.norm(ELECTRODE_DR_MM[:, None] - ELECTRODE_DR_MM[None], axis=2)
NEIGHBOURS = (_BETWEEN_MM <= REACH_MM) & ~np.eye(ELECTRODES, dtype=bool)


@dataclass(frozen=True)
class Contact:
    """One contact: ``poc_mm`` (3,) on the core's surface and the ``share`` of the force, 0 to 1.

    ``electrodes`` are the indices, from 0, of those that belong to it, strongest first.
    """

    poc_mm: Floats
    share: float
    electrodes: tuple[int, ...]


def contacts(row: npt.NDArray[Any], *, least_n: float = 0.05) -> list[Contact]:
    """The contacts of one frame, strongest first.

    There are none if every electrode is below ``least_n`` by Eq 4, or one is missing. ``row`` is a frame of
    ``biotac.load`` or of a live hand, or signals (19,). Shares are an estimate from Eq 4, good to about 0.1
    (host/docs/guides/features.md).
    """
    force = electrode_force(row if row.dtype.names else row[None, :])[0]
    if np.isnan(force).any() or force.max() < least_n:
        return []
    pressed = force > LEAST_SHARE * force.max()
    summit = _climb(force, pressed)
    groups = [np.flatnonzero(pressed & (summit == top)) for top in _merged(force, pressed, summit)]
    part = [float((force[group] ** SHARE_POWER).sum()) for group in groups]
    found = []
    for group, part_share in zip(groups, part, strict=True):
        weight = force[group]
        middle = (surface.ELECTRODE_MM[group] * weight[:, None]).sum(axis=0) / weight.sum()
        order = group[np.argsort(-weight)]
        found.append(Contact(surface.project(middle[None])[0], part_share / sum(part), tuple(order.tolist())))
    return sorted(found, key=lambda contact: -contact.share)


def _climb(force: Floats, pressed: npt.NDArray[np.bool_]) -> npt.NDArray[np.int64]:
    """The summit (19,) that each electrode climbs to; the electrode itself where no neighbour is stronger."""
    up = np.arange(ELECTRODES)
    for k in np.flatnonzero(pressed):
        near = np.flatnonzero(NEIGHBOURS[k] & pressed)
        if len(near) and force[near].max() > force[k]:
            up[k] = near[np.argmax(force[near])]
    for _ in range(ELECTRODES):
        up = up[up]
    return up


def _merged(force: Floats, pressed: npt.NDArray[np.bool_], summit: npt.NDArray[np.int64]) -> list[int]:
    """The summits that are contacts of their own; ``summit`` is changed in place where a lower one joins a higher."""
    tops = sorted(set(summit[pressed].tolist()), key=lambda k: -force[k])
    kept: list[int] = []
    for top in tops:
        basin = np.flatnonzero(pressed & (summit == top))
        best, into = 0.0, top
        for other in kept:
            other_basin = np.flatnonzero(pressed & (summit == other))
            touching = NEIGHBOURS[np.ix_(basin, other_basin)]
            if touching.any():
                passes = np.minimum(force[basin][:, None], force[other_basin][None, :])[touching]
                if passes.max() > best:
                    best, into = float(passes.max()), other
        if best > PASS_SHARE * force[top]:
            summit[basin] = into
        else:
            kept.append(top)
    return kept
