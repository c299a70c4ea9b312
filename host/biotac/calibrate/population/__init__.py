"""Force for a finger without its own calibration: a population map, fitted to other fingers.

- ``population_map``: the map, its file, and the one that comes with the package

``biotac.calibrate.press.few_shot`` improves it with five presses on a scale, or known weights. A file holds
coefficients and their provenance, never recordings.
"""

from __future__ import annotations

from ...map.columns import SIGNAL_COUNTS
from ...map.population import LEFT, WEIGHT_BITS, bounded_q4, halves
from .population_map import (
    AXES,
    COLUMNS,
    PARTS,
    ROWS_AT_ONCE,
    Population,
    Sums,
    Trained,
    columns,
    dumps,
    load,
    provenance_of,
)

__all__ = [
    "AXES", "COLUMNS", "LEFT", "PARTS", "ROWS_AT_ONCE", "SIGNAL_COUNTS", "WEIGHT_BITS", "Population", "Sums", "Trained",
    "bounded_q4", "columns", "dumps", "halves", "load", "provenance_of",
]  # fmt: skip
