"""Calibration by presses of known force, on a scale, by weights or beside a force sensor.

- ``force_source``: the part of a frame that presses are found in, and the force that a file or a scenario knows
- ``detector``: finds rest and held presses; ``guide``: guides through them on a board;
  ``drive``: has a hand press by itself
- ``pressure``: K of a finger's pressure (Navarro et al. 2015); ``pressure_procedure``: on a board and from a recording
- ``known_force``: the population map fitted to presses by ``few_shot``; ``weights``: forces of masses on tilted blocks
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...renamed import old_names
from .detector import Press, Procedure
from .drive import Move, drive
from .few_shot import Scale, scale_of, shrink_to
from .force_source import rows_of, truth_of
from .guide import guide
from .pressure import (
    CALIBRATION_FORCES_N,
    PAPER_ERROR,
    VERIFICATION_FORCES_N,
    PressureFit,
    Verification,
    fit,
    relative_error,
    verify,
    with_board_force,
)
from .pressure_procedure import put, with_gain

__all__ = [
    "CALIBRATION_FORCES_N", "PAPER_ERROR", "VERIFICATION_FORCES_N", "Move", "Press", "PressureFit", "Procedure",
    "Scale", "Verification", "drive", "fit", "guide", "put", "relative_error", "rows_of", "scale_of", "shrink_to",
    "truth_of", "verify", "with_board_force", "with_gain",
]  # fmt: skip

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__, {"Fit": "PressureFit"})
