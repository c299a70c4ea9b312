"""The direction of an edge on the skin, learnt from presses of a bar.

Moments of the pattern do not give it: the electrodes are 4 to 7 mm apart and an edge is narrower than that, so their
signals depend on the edge's place and direction at once. For an edge at angle a, the net gives cos 2a and sin 2a: half
a turn gives the same edge, and averaging the two averages directions.
"""

from __future__ import annotations

import numpy as np

from . import inputs, nets
from .nets import Floats
from .roc import log_change

COMPONENTS = 24


def columns(above: Floats, tare: Floats) -> Floats:
    """The net's inputs (n, levels * 19) from presses ``above`` (n, levels, 19), in counts above the tare.

    ``tare`` is (19,), or any shape that broadcasts to that of ``above``. The levels are instants of a press, e.g. at a
    quarter, half and all of the load, the same in training and use.
    """
    n, levels, electrodes = above.shape
    flat = above.reshape(-1, electrodes)
    return log_change(flat, np.broadcast_to(tare, above.shape).reshape(flat.shape)).reshape(n, levels * electrodes)


def train(seen: Floats, angle_rad: Floats, *, seed: int = 0, steps: int = nets.STEPS) -> nets.Net:
    """A net for direction(), from columns() (n, d) and the edge's direction (n,) in rad.

    The last 15 % of the rows decide when to stop.
    """
    double = np.column_stack([np.cos(2.0 * angle_rad), np.sin(2.0 * angle_rad)])
    stop = len(seen) - max(1, round(0.15 * len(seen)))
    reduction = inputs.principal(seen[:stop], 0.0, COMPONENTS)
    x = reduction(seen)
    return nets.train(x[:stop], double[:stop], (x[stop:], double[stop:]), seed=seed, steps=steps).after(reduction)


def direction(net: nets.Net, seen: Floats) -> Floats:
    """The edge's direction (n,) in rad, 0 to pi, from columns(): 0 is towards the tip, pi/2 towards E11's side."""
    double = net(seen)
    return np.mod(0.5 * np.arctan2(double[:, 1], double[:, 0]), np.pi)


def turn(estimate_rad: Floats, truth_rad: Floats) -> Floats:
    """The difference ``estimate_rad`` - ``truth_rad`` of two edge directions (n,), -pi/2 to pi/2 rad."""
    return np.mod(estimate_rad - truth_rad + np.pi / 2, np.pi) - np.pi / 2
