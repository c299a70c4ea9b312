"""The compiled firmware core in Python: results, a finger's tare machine, geometry.

The names are imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import lazy_loader

from ..kernels import geometry

if TYPE_CHECKING:
    from .bands import BANDS_HZ, SAMPLES, pac_bands
    from .finger import to_frames

__all__ = ["BANDS_HZ", "SAMPLES", "geometry", "pac_bands", "to_frames"]

__getattr__, __dir__, _ = lazy_loader.attach(
    __name__, [], {"bands": ["BANDS_HZ", "SAMPLES", "pac_bands"], "finger": ["to_frames"]}
)
