"""Calibrations of single fingers: their values, and where they are kept.

- ``values``: what a calibration is, ``biotac.Calibration``
- ``file``: as JSON, for people and with its provenance
- ``record``: as the bytes that a board keeps in its flash
- ``eeprom``: that record in an EEPROM on the finger's harness, through ``chip``
- ``blob``, ``transfer``, ``map_file``: a finger's wrench map, to the board and back, and as a file
- ``harness``: which EEPROMs belong to a port's fingers
"""

from __future__ import annotations

from .values import Calibration

__all__ = ["Calibration"]
