"""Recordings: MCAP files that hold the raw wire, so that nothing a board said is ever lost.

A block a second, taken apart by finger and field so that it can be put together again to the byte, each part in a
chunk of its own: a killed recorder loses at most its last second. Beside it, thinned, JSON messages that Foxglove and
PlotJuggler understand (plots.py). The metadata record ``biotac`` holds who sent them and with which settings; the
schema record of the wire holds protocol/schema.json of the day. host/docs/recording.md describes it all.
"""

from __future__ import annotations

from .part import load
from .reader import Recording
from .writer import Recorder

__all__ = ["Recorder", "Recording", "load"]
