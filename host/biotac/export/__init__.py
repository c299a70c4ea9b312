"""Recordings as files for other programs, one format a module.

The rows' own names and units, a frame_id per finger, flags beside them, invalid values as the format has them; the
columns stand in wire/fields.py and in host/docs/rows.md. A ROS 2 bag has its own messages and SI units.
"""

from __future__ import annotations

from .columns import BANDS_COLUMNS, COLUMNS, PAC_COLUMNS, Table, tables
from .formats import FORMATS, export

__all__ = ["BANDS_COLUMNS", "COLUMNS", "FORMATS", "PAC_COLUMNS", "Table", "export", "tables"]
