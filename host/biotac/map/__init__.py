"""Wrench maps: a finger's force, torque and torsion as a sum of blocks of columns (protocol/SPEC.md, Wrench maps).

- ``columns``: the columns in which a map is linear
- ``fitted``: the map as fitted, in float64, and from there to ``board_map``: as a board stores and runs it
- ``float64``, ``bound``: a board's map without its rounding, and how much that can be
- ``file``: the JSON file, with either or both
- ``population``: the map of other fingers that every board has
"""

from __future__ import annotations

from .file import dumps_fitted, load_fitted
from .fitted import WrenchMap

__all__ = ["WrenchMap", "dumps_fitted", "load_fitted"]
