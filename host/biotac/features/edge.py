"""Which way an edge lies on the skin, learnt from presses of a bar.

Moments of the pattern do not tell: the electrodes stand 4 to 7 mm apart, and an edge is narrower than that, so what
reaches them names the edge's place and direction at once. The net gives cos 2a and sin 2a: a turned by half a turn is
the same edge, and a mean of the two is a mean of directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from . import inputs, levenberg
from .roc import log_change
from .signals import Floats

COMPONENTS = 24


@dataclass(frozen=True)
class Orientation:
    """A trained net behind its reduction."""

    reduction: inputs.Reduction
    net: levenberg.Net

    def __call__(self, columns: npt.ArrayLike) -> Floats:
        """The edge's direction (n,) in rad, 0 to pi: 0 to the tip, pi/2 to E11's side."""
        double = self.net(self.reduction(columns))
        result: Floats = np.mod(0.5 * np.arctan2(double[:, 1], double[:, 0]), np.pi)
        return result


def columns(above: Floats, tare: Floats) -> Floats:
    """What the net sees of presses (n, levels, 19), counts above ``tare`` (19,) or alike: (n, levels * 19).

    The levels are instants of a press, e.g. a quarter, half and all of its load, the same in training and use.
    """
    n, levels, electrodes = above.shape
    flat = above.reshape(-1, electrodes)
    return log_change(flat, np.broadcast_to(tare, above.shape).reshape(flat.shape)).reshape(n, levels * electrodes)


def train(seen: Floats, angle_rad: Floats, *, seed: int = 0, steps: int = levenberg.STEPS) -> Orientation:
    """Of columns() (n, d) and the edge's direction (n,) in rad; the last 15 % of the rows stop the training."""
    double = np.column_stack([np.cos(2.0 * angle_rad), np.sin(2.0 * angle_rad)])
    stop = len(seen) - max(1, round(0.15 * len(seen)))
    reduction = inputs.principal(seen[:stop], 0.0, COMPONENTS)
    x = reduction(seen)
    net = levenberg.train(x[:stop], double[:stop], (x[stop:], double[stop:]), seed=seed, steps=steps)
    return Orientation(reduction, net)


def turn(said_rad: Floats, truth_rad: Floats) -> Floats:
    """How far apart two directions (n,) of edges are, -pi/2 to pi/2."""
    result: Floats = np.mod(said_rad - truth_rad + np.pi / 2, np.pi) - np.pi / 2
    return result
