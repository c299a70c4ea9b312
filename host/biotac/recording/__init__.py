"""Recordings: MCAP files that hold every message the board sent.

There is one block per second. It is split by finger and field, and each part is a chunk of its own: a killed recorder
loses at most its last second. Thinned ROS 2 messages for Foxglove and PlotJuggler are stored beside it (plots.py). The
metadata record ``biotac`` names the board, its sensors and the settings in force; the wire's schema record holds
protocol/schema.json as it was at the time of recording. host/docs/guides/recording.md describes the format.
"""

from __future__ import annotations

from .crosscheck import CrossCheck
from .npz_file import counts_field, read_npz, to_lin_frame
from .reader import Recording
from .selection import load

__all__ = ["CrossCheck", "Recording", "counts_field", "load", "read_npz", "to_lin_frame"]
