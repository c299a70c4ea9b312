"""Learning from touch: curvature, edges, force by nets, textures; and the probes of Wettels and Loeb 2011.

``nets`` is the perceptron, ``inputs`` the reductions for it, ``smooth`` the paper's LOWESS; ``stimulations`` presses
``probes`` on an emulated finger.
"""
