"""Sources of counts for the emulated sensor: scenarios through a physics model, and recordings."""

from .loading import bundled_scenarios, load_source
from .source import Source, Truth

__all__ = ["Source", "Truth", "bundled_scenarios", "load_source"]
