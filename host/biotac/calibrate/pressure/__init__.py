"""Force from static pressure: calibration and checks after Navarro et al. 2015.

- ``formulas``: the paper's equations in float64
- ``check``: the board's own numbers held to them, frame by frame
- ``rows``: what a calibration looks at of a frame
- ``presses``: what of a press was held, what of it is rest, and the guided sequence of presses
- ``force_source``: where the force comes from that the fingers are calibrated to
- ``fit``: K and the relative error of a finger; what is refused
- ``guided``: all that with a board; ``from_recording``: with a recording
- ``report``: what it came to
"""
