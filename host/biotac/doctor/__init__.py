"""Finds the faults of a board, its sensors, its link or this computer; every finding names the cure.

Facts are collected first (``system``, ``listening``), then checked: a check is a pure function of ``Facts``. Every
finding's code is in ``catalogue``, which is host/docs/reference/doctor.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..renamed import old_names
from . import channels, connection, sensors, timing
from .catalogue import CATALOGUE, Finding
from .facts import ExaminedBoard, Facts, SystemFacts


def diagnose(facts: Facts) -> list[Finding]:
    """All findings, in the order in which to cure them."""
    board = facts.board
    if board is None:
        return list(connection.check(facts))
    of_board = (
        *sensors.check(board, facts.expected_fingers),
        *timing.check(board, fed=facts.pair is not None),
        *channels.check(board),
    )
    return [*connection.check(facts), *facts.leads, *of_board]


__all__ = ["CATALOGUE", "ExaminedBoard", "Facts", "Finding", "SystemFacts", "diagnose"]

if not TYPE_CHECKING:
    __getattr__ = old_names(__name__, {"judge": "diagnose"})
