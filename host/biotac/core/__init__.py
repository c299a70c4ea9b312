"""The compiled firmware core in Python: results, a finger's tare machine, geometry.

Its names are imported on first use: the map's room is below this one, and needs its geometry.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from . import geometry
    from .bands import BANDS_HZ, SAMPLES, pac_bands
    from .finger import to_frames

__all__ = ["BANDS_HZ", "SAMPLES", "geometry", "pac_bands", "to_frames"]

_HOMES = {"BANDS_HZ": ".bands", "SAMPLES": ".bands", "pac_bands": ".bands", "to_frames": ".finger"}


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(_HOMES.get(name, f".{name}"), __name__)
    return getattr(module, name, module)
