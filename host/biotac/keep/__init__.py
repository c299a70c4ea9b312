"""Calibrations of single fingers, which outlive a session.

- ``calibration``: ``biotac.Calibration``, the values
- ``calibration_file``: as JSON, readable and with provenance
- ``eeprom``: as the record that a board keeps in its flash, and that in an EEPROM on the finger's harness, by ``chip``
- ``harness``: which EEPROMs belong to a port's fingers
"""

from __future__ import annotations

from .calibration import Calibration

__all__ = ["Calibration"]
