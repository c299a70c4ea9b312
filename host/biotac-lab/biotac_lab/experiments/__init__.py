"""The papers' experiments, repeated on the emulated sensor or on a recording.

One file per experiment with ``run``, which gives a Report. ``trial`` plays an emulated finger through the board's own
code, ``laboratory`` reads a laboratory's own trial, ``estimates`` fits the paper's scales, ``weight`` is what the
trials with a weight share. ``command`` lists them all.
"""
