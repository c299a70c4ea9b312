"""The papers' experiments, done again on the emulated sensor or on a recording.

One file an experiment: a function that runs it and returns its figures, one that draws them, and its table
against the paper's numbers. ``trial`` plays an emulated finger through the board's own code, ``laboratory``
reads a laboratory's own trial, ``lin`` fits the paper's scales. ``catalogue`` names them all.
"""

from __future__ import annotations
