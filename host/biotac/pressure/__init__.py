"""Force from static pressure: calibration and checks after Navarro et al. 2015.

- ``formulas``: the paper's equations in float64
- ``check``: the board's own numbers held to them, frame by frame
- ``plateaus``: what of a press was held, and what of it is rest
- ``fit``: K, P0 and the relative error of a finger; what is refused
- ``procedure``: the guided sequence of presses, as a machine that consumes frames
- ``reference``: where the force comes from that the fingers are calibrated to
"""
