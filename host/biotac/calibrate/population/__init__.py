"""Force for a finger without its own calibration: a population map, fitted to other fingers.

- ``population_map``: the map, its file, and the one that comes with the package
- ``training``, ``held_out_error``: fits the map to force-plate recordings, and judges it

``biotac.calibrate.press.few_shot`` improves it with five presses on a scale, or known weights. A file holds
coefficients and their provenance, never recordings.
"""
