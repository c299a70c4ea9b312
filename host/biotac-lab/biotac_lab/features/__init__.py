"""Features of a touch by formula: place, number of contacts, temperature, and whether the grip holds.

Only NumPy is needed; the learnt ones (curvature, edges, force by nets, textures) are in biotac_lab.learn.
"""

from __future__ import annotations

from . import grip, paf, several, signals, thermal

__all__ = ["grip", "paf", "several", "signals", "thermal"]
