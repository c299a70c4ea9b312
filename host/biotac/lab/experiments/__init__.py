"""The papers' experiments, repeated on the emulated sensor or on a recording.

One file per experiment: a function that runs it and returns its figures, one that draws them, and a table that compares
them with the paper. ``trial`` plays an emulated finger through the board's own code, ``laboratory`` reads a
laboratory's own trial, ``lin`` fits the paper's scales. ``catalogue`` lists them all.
"""

from __future__ import annotations
