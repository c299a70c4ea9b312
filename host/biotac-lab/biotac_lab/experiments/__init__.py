"""The papers' experiments, repeated on the emulated sensor or on a recording.

One file per experiment with ``run``, which gives a Report. ``trial`` plays an emulated finger through the board's own
code, ``laboratory`` reads a laboratory's own trial, ``estimates`` fits the paper's scales, ``weight`` is common to the
trials with a weight. ``command`` lists them all.
"""
