"""Sources of counts for the emulated sensor: scenarios through a physics model, and recordings."""

from __future__ import annotations

from .gains import fit_gains
from .loading import bundled_scenarios, load_source
from .physics import (
    GAP_MM,
    PLATE_MM,
    PROFILES,
    SKIN,
    Finger,
    Footprints,
    Profile,
    Skin,
    States,
    counts_at,
    deform,
    resistance_at,
    resistance_share,
)  # fmt: skip
from .random_loads import plate_recording, random_loads
from .sampling import sample, tdc_counts
from .scenario import FLAT_MM
from .source import Source, Truth
from .timeline import Pose, Track

__all__ = [
    "FLAT_MM", "GAP_MM", "PLATE_MM", "PROFILES", "SKIN", "Finger", "Footprints", "Pose", "Profile", "Skin", "Source",
    "States", "Track", "Truth", "bundled_scenarios", "counts_at", "deform", "fit_gains", "load_source",
    "plate_recording", "random_loads", "resistance_at", "resistance_share", "sample", "tdc_counts",
]  # fmt: skip
