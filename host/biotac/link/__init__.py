"""Ways to reach a board; a PORT string names one. ports.py lists the kinds, and biotac.open explains each."""

from __future__ import annotations

from .base import Link
from .ports import open_link

__all__ = ["Link", "open_link"]
