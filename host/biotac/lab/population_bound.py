"""How far a board's population force may be off core.population, from the formats of its numbers alone."""

from __future__ import annotations

from functools import cache

import numpy as np

from ..core import population
from ..core.board_map import BoardMap
from ..core.geometry import Floats
from ..core.map_bound import bound_of
from ..core.map_columns import Signals
from ..wire.frames import FORCE_LSB_PER_N


@cache
def _board_map() -> BoardMap:
    return population.board_map(population.blocks())


def force_bound_n(signals: Signals, lin_bound_n: float) -> Floats:
    """(n, 3) in N, with the part that is Lin's off by ``lin_bound_n``."""
    part = (population.share(signals) / population.ALL)[:, None]
    wanted = {(kind, gate): its * FORCE_LSB_PER_N for kind, gate, its in population.blocks()}
    off = bound_of(_board_map(), wanted, signals) / FORCE_LSB_PER_N
    result: Floats = np.where(part > 0, part * off, 0.0) + (1 - part) * lin_bound_n + 0.5 / FORCE_LSB_PER_N
    return result
