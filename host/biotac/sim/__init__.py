"""Sources of counts for the emulated sensor: scenarios through a physics model, and recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..renamed import old_names
from .faults import EVERY_FAULT, FAULTS
from .loading import bundled_scenarios, load_source
from .physics import (
    GAP_MM,
    PLATE_MM,
    PROFILES,
    SKIN,
    Footprints,
    Profile,
    SimFinger,
    Skin,
    States,
    counts_of,
    deform,
    resistance_at,
)  # fmt: skip
from .random_loads import plate_recording, random_loads
from .sampling import Sampler, sample, tdc_counts
from .scenario import FLAT_MM
from .source import Source, Truth
from .timeline import Pose, Track
from .touch import Course, Load, SimTouch
from .world import LockStep, World, world

__all__ = [
    "EVERY_FAULT", "FAULTS", "FLAT_MM", "GAP_MM", "PLATE_MM", "PROFILES", "SKIN", "Course", "Footprints",
    "Load", "LockStep", "Pose", "Profile", "Sampler", "SimFinger", "Skin", "Source", "States", "SimTouch", "Track",
    "Truth", "World", "bundled_scenarios", "counts_of", "deform", "load_source", "plate_recording",
    "random_loads", "resistance_at", "sample", "tdc_counts", "world",
]  # fmt: skip

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__, {"Finger": "SimFinger", "Touch": "SimTouch"})
