"""Calibrations of single fingers, which outlive a session.

- ``calibration``: ``biotac.Calibration``, the values
- ``calibration_file``: as JSON, readable and with provenance
- ``flash_record``: as the bytes that a board keeps in its flash
- ``eeprom``: a record in an EEPROM on the finger's harness, through ``chip``
- ``harness``: which EEPROMs belong to a port's fingers
"""

from __future__ import annotations

from .calibration import Calibration

__all__ = ["Calibration"]
