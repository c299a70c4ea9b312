"""Force/torque sensors that say what a finger is loaded with: their files, their live streams, their clocks.

A reference measures in its own axes about its own origin; a Mounting turns that into the force on the finger in
Lin's frame. Nothing here knows of models or of boards.
"""

from __future__ import annotations

from .mounting import LIN, Mounting
from .samples import Reference, Samples

__all__ = ["LIN", "Mounting", "Reference", "Samples"]
