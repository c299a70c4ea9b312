"""Recordings as files for other programs, one format a module.

SI units (m, N, N*m, s), a frame_id per finger, invalid results as NaN, flags beside them; the columns stand
in columns.py and in host/docs/recording.md.
"""

from __future__ import annotations

from .columns import COLUMNS, PAC_COLUMNS, Column, Table, tables
from .formats import FORMATS, export

__all__ = ["COLUMNS", "FORMATS", "PAC_COLUMNS", "Column", "Table", "export", "tables"]
