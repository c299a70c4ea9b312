"""Host side of the open BioTac gateway: forces, points of contact and torques from BioTac fingertips.

>>> import biotac
>>> with biotac.open("sim:press.toml") as hand:
...     frames = hand.read(seconds=1.0)
>>> frames["force_n"].shape
(100, 3)
"""

import lazy_loader

# The public names stand in __init__.pyi; each is imported when it is first used.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
