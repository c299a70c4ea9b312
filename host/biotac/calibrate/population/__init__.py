"""Force for a finger without its own calibration: a population map, fitted to other fingers.

- ``training``: fits the map to force-plate recordings
- ``fewshot``: improves it with five presses on a scale, known ``weights`` or a minute on a plate
- ``presses``: gets such presses from a board or a recording
- ``worth``: the error that each leaves on a finger that the map has not seen
- ``keeping``: writes and reads its file, and has the one that comes with the package

A file holds coefficients and their provenance, never recordings.
"""
