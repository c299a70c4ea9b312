"""Exporting recordings to files for other programs, one module per format.

Exports have the rows' names, units and flags, a frame_id per finger, and invalid values as is usual in the format. The
columns are listed in wire/fields.py and host/docs/reference/rows.md. A ROS 2 bag has ROS messages and SI units.
"""

from __future__ import annotations

from .columns import BANDS_COLUMNS, COLUMNS, PAC_COLUMNS, Table, tables
from .formats import FORMATS, export

__all__ = ["BANDS_COLUMNS", "COLUMNS", "FORMATS", "PAC_COLUMNS", "Table", "export", "tables"]
