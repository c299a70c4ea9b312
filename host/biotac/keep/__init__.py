"""What outlives a session: calibrations and wrench maps of single fingers, as values and as files.

- ``values``: ``biotac.Calibration``
- ``calibration_file``, ``map_file``: as JSON, readable and with provenance
- ``record``, ``map_blob``: as the bytes that a board keeps in its flash
- ``eeprom``: a record in an EEPROM on the finger's harness, through ``chip``
- ``harness``: which EEPROMs belong to a port's fingers
"""

from __future__ import annotations

from .calibration import Calibration

__all__ = ["Calibration"]
