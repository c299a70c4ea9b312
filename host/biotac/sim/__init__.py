"""Sources of counts for the emulated sensor: scenarios through a physics model, and recordings."""

from .source import Source, Truth, bundled_scenarios, load_source

__all__ = ["Source", "Truth", "bundled_scenarios", "load_source"]
