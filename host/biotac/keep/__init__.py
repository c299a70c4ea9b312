"""Calibrations of single fingers, which outlive a session.

- ``calibration``: ``biotac.Calibration``, the values
- ``calibration_file``: as JSON, readable and with provenance
"""

from __future__ import annotations

from .calibration import Calibration

__all__ = ["Calibration"]
