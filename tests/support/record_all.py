"""A recording to look at."""

from __future__ import annotations

from pathlib import Path

import biotac


def record_all(source: str, path: Path) -> Path:
    """Record all that a simulated board plays; returns ``path``."""
    with biotac.open(source) as hand:
        hand.record(path)
        hand.read_batch(100)
    return path
