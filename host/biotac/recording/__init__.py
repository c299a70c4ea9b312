"""Recordings: MCAP files that hold every message the board sent.

There is one block per second: the packets as the board sent them, and a head that describes them. Each part is a
chunk of its own: a killed recorder loses at most the last second. Columns are made when they are read, by the decoder
of the live stream. The metadata record ``biotac`` names the board, the sensors and the settings in force. The schema
record holds protocol/schema.json, without texts, as it was at the time of recording; the packets are decoded by it.
host/docs/guides/recording.md describes the format.
"""

from __future__ import annotations

from .crosscheck import CrossCheck
from .npz_file import counts_field, read_npz, to_lin_frame
from .reader import Recording
from .selection import load

__all__ = ["CrossCheck", "Recording", "counts_field", "load", "read_npz", "to_lin_frame"]
