"""Recordings: MCAP files that hold the raw wire, so that nothing a board said is ever lost.

A block a second on ``/biotac/wire``, each the bytes as they came, each in a chunk of its own: a killed
recorder loses at most its last second. Beside it, thinned, JSON messages that Foxglove and PlotJuggler
understand (plots.py). The metadata record ``biotac`` holds who sent them and with which settings; the schema
record of the wire holds protocol/schema.json of the day. host/docs/recording.md describes it all.
"""

from __future__ import annotations

from .reader import Recording, load
from .writer import Recorder

__all__ = ["Recorder", "Recording", "load"]
