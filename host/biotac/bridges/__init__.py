"""Bridges that pass live streams on to other systems."""
