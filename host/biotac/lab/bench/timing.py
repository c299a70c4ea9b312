"""Times contestants against each other in one run: interleaved rounds, warmed buffers, medians."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Contestant:
    """What to run, and how many frames or messages one run handles."""

    name: str
    count: int
    run: Callable[[], Any]


@dataclass(frozen=True)
class Row:
    """Nanoseconds per frame or message over the rounds."""

    name: str
    median_ns: float
    min_ns: float
    max_ns: float


@dataclass(frozen=True)
class Ratio:
    """Median time of ``slower`` over that of ``faster``, and the smallest ratio required."""

    faster: str
    slower: str
    ratio: float
    asked: float | None


def timed(contestants: list[Contestant], rounds: int, clock_ns: Callable[[], int] = time.perf_counter_ns) -> list[Row]:
    """Time each contestant right after an untimed run of it, which brings in its own pages and caches."""
    times: dict[str, list[float]] = {c.name: [] for c in contestants}
    for _ in range(rounds):
        for contestant in contestants:
            contestant.run()
            start = clock_ns()
            contestant.run()
            times[contestant.name].append((clock_ns() - start) / contestant.count)
    return [Row(name, statistics.median(ns), min(ns), max(ns)) for name, ns in times.items()]
