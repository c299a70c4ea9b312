"""What is wrong with a board, its sensors, its link or this computer, each in words with its cure.

Facts are collected first (``system``, ``listening``), then judged: a check is a pure function of ``Facts``. Every
finding's code stands in ``catalogue`` and, for people, in host/docs/doctor.md.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from . import bus, connection, leads, sensors, tare, timing, version
from .catalogue import CATALOGUE, Entry, Finding, Severity
from .facts import BoardFacts, Facts, PairFacts, SystemFacts

CHECKS: tuple[Callable[[Facts], Iterator[Finding]], ...] = (
    connection.check,
    version.check,
    leads.check,
    sensors.check,
    bus.check,
    timing.check,
    tare.check,
)


def judge(facts: Facts) -> list[Finding]:
    """All findings, in the order in which they should be cured."""
    return [finding for check in CHECKS for finding in check(facts)]


__all__ = [
    "CATALOGUE",
    "CHECKS",
    "BoardFacts",
    "Entry",
    "Facts",
    "Finding",
    "PairFacts",
    "Severity",
    "SystemFacts",
    "judge",
]
