"""Wrench maps: a finger's force, torque and torsion as a sum of blocks of columns (protocol/SPEC.md, Wrench maps).

- ``columns``: the columns in which a map is linear
- ``fitted``: the map as fitted, in float64, and from there to ``board_map``: as a board stores and runs it
- ``float64``, ``bound``: a board's map without rounding, and the largest effect of that
- ``file``: the JSON file, with either or both
- ``margin``: how far a map's normal and shear part may be off
- ``population``: the map of other fingers that every board has
"""

from __future__ import annotations

from .file import dumps_fitted, load_fitted
from .fitted import WrenchMap
from .margin import Margin, bands, fit_margin, published_parts
from .population import unfelt_n

__all__ = ["Margin", "WrenchMap", "bands", "dumps_fitted", "fit_margin", "load_fitted", "published_parts", "unfelt_n"]
