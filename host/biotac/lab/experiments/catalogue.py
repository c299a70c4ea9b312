"""The experiments by name. A new one is a line here and a module of that name, with `_` for `-`, beside this one."""

from __future__ import annotations

import importlib
from typing import cast

from .outcome import Experiment

NAMES = {
    "poke": "point of contact under a 2 mm probe on every electrode (Lin 2013, table 2)",
    "plate-normal": "normal at the point of contact against a flat plate's",
    "shear": "a weight pushed sideways (Lin 2013, figure 3)",
    "torsion": "a weight turned both ways (Lin 2013, figure 9)",
    "torsion-shear": "a weight turned while it is pushed (Lin 2013, figure 10)",
    "shear-torsion": "shear and torsion at once on held-out places, calibrated against the paper's model",
    "hold": "light holds spliced into presses, against the residue that presses leave",
    "navarro": "pressure calibration and its verification press (Navarro et al.)",
    "seed000": "every table and figure on learning point of contact, curvature and force (Wettels and Loeb)",
}


def load(name: str) -> Experiment:
    """The module of the experiment ``name``."""
    return cast(Experiment, importlib.import_module(f"{__package__}.{name.replace('-', '_')}"))
