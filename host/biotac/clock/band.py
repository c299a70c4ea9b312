"""All straight lines that lie below some points and above others.

This separates clocks from delays (segment.py): the clock's line may not lie above the point of any message's arrival,
nor below the point of any question's sending. Every line that meets all these conditions is a possible clock, so the
extremes of these lines bound the truth without any assumption about how delays are distributed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# How strongly to favour slopes with more room: quick messages are rare in both directions, so the true slope has
# nearly the most. The value is not critical: the bound does not depend on it.
ROOM_POWER = 3
STEPS = 257


@dataclass(frozen=True)
class Band:
    """The lines y = a + slope x that fit: for each of ``slopes`` (n,), a is between ``low`` and ``high`` (n,).

    Between two of these slopes the limits are linear, so the set is the polygon with these corners.
    """

    slopes: Array
    low: Array
    high: Array

    def at_zero(self) -> tuple[float, float]:
        """Smallest and largest y at x = 0."""
        return float(self.low.min()), float(self.high.max())

    def centre(self) -> tuple[float, float]:
        """The y at x = 0 and the slope of a line in the middle of all, where there is most room."""
        slopes = np.linspace(self.slopes[0], self.slopes[-1], STEPS)
        low, high = np.interp(slopes, self.slopes, self.low), np.interp(slopes, self.slopes, self.high)
        widest = float((high - low).max())
        room = ((high - low) / widest) ** ROOM_POWER if widest > 0 else np.ones(STEPS)
        return float(np.average((low + high) / 2, weights=room)), float(np.average(slopes, weights=room))


def between(below: tuple[Array, Array], above: tuple[Array, Array], slopes: tuple[float, float]) -> Band | None:
    """The lines under the points ``below`` (x, y) and over the points ``above`` (x, y); None when there are none.

    Both need at least one point; ``slopes`` are the smallest and the largest slope to consider.
    """
    ux, uy = hull(*below, side=1.0)
    lx, ly = hull(*above, side=-1.0)
    with np.errstate(over="ignore"):  # a slope too steep for a float is clipped like any other steep one
        turns = np.concatenate([slopes, np.diff(uy) / np.diff(ux), np.diff(ly) / np.diff(lx)])
    b = np.unique(np.clip(turns, *slopes))
    high = (uy - b[:, None] * ux).min(axis=1)
    low = (ly - b[:, None] * lx).max(axis=1)
    # The width is concave in the slope, and linear between the values in b: the slopes that fit are one interval.
    width = high - low
    fits = np.flatnonzero(width >= 0)
    if not len(fits):
        return None
    first, last = int(fits[0]), int(fits[-1])
    parts = [(b[first : last + 1], low[first : last + 1], high[first : last + 1])]
    for inside, outside in ((first, first - 1), (last, last + 1)):
        if 0 <= outside < len(b):
            share = width[inside] / (width[inside] - width[outside])
            edge = b[inside] + share * (b[outside] - b[inside])
            y = high[inside] + share * (high[outside] - high[inside])
            parts.insert(0 if outside < inside else len(parts), (np.array([edge]), np.array([y]), np.array([y])))
    return Band(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def hull(x: Array, y: Array, *, side: float) -> tuple[Array, Array]:
    """Corners of the points' convex hull, left to right: the lower side for ``side`` 1, the upper one for -1.

    Of points with the same x only the outermost counts.
    """
    order = np.lexsort((side * y, x))
    corners: list[tuple[float, float]] = []
    for px, py in zip(x[order].tolist(), y[order].tolist(), strict=True):
        if corners and corners[-1][0] == px:
            continue
        while len(corners) > 1:
            (ax, ay), (bx, by) = corners[-2:]
            if side * ((bx - ax) * (py - ay) - (by - ay) * (px - ax)) > 0:
                break
            corners.pop()
        corners.append((px, py))
    found = np.array(corners)
    return found[:, 0], found[:, 1]
