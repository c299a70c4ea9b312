"""Force from static pressure: calibration and checks after Navarro et al. 2015.

- ``formulas``: the paper's equations in float64
- ``check``: checks the board's results against them, frame by frame
- ``rows``: the part of a frame that a calibration uses
- ``presses``: finds rest and held presses, and guides through a sequence of presses
- ``force_source``: the force that fingers are calibrated to
- ``fit``: K of a finger, its relative error, and what is refused
- ``guided``: the whole procedure on a board; ``from_recording``: from a recording
- ``report``: the results
"""
