"""Compact: see recording/compact.py, which also reads it."""

from __future__ import annotations

from pathlib import Path

from ..recording.compact import compact, write_compact
from ..recording.reader import Recording
from .columns import Table
from .formats import Show

PAC_APART = False


def write(place: Path, made: list[Table], recording: Recording, show: Show) -> None:
    """The recording's integers rather than the tables' SI numbers: nothing is lost and nothing is longer."""
    write_compact(place, compact(recording), show)
