"""Calibration by presses of known force, on a scale, by weights or beside a force sensor.

- ``rows``: the part of a frame that presses are found in; ``force_source``: the force that a file or a scenario knows
- ``detector``: finds rest and held presses; ``guide``: guides through them on a board
- ``pressure``: K of a finger's pressure (Navarro et al. 2015); ``pressure_procedure``: on a board and from a recording
- ``known_force``: the population map fitted to presses by ``few_shot``; ``weights``: forces of masses on tilted blocks
"""
