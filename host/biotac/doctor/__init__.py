"""Finds what is wrong with a board, its sensors, its link or this computer; every finding names its cure.

Facts are collected first (``system``, ``listening``), then judged: a check is a pure function of ``Facts``. Every
finding's code is listed in ``catalogue`` and, for people, in host/docs/reference/doctor.md.
"""

from __future__ import annotations

from . import bus, connection, leads, sensors, signals, tare, timing, version
from .catalogue import CATALOGUE, Finding
from .facts import BoardFacts, Facts, PairFacts, SystemFacts


def judge(facts: Facts) -> list[Finding]:
    """All findings, in the order in which to cure them."""
    of = (connection, version, leads, sensors, bus, timing, tare, signals)
    return [finding for module in of for finding in module.check(facts)]


__all__ = ["CATALOGUE", "BoardFacts", "Facts", "Finding", "PairFacts", "SystemFacts", "judge"]
