"""Contestants against each other in one run: interleaved rounds, warmed buffers, medians."""

from __future__ import annotations

import importlib
import statistics
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from biotac import InputError

from ..report import Table

#: (faster, slower, smallest ratio of their times); None where there is no requirement.
Asked = Sequence[tuple[str, str, float | None]]


@dataclass(frozen=True)
class Contestant:
    """A function, and how many frames or messages one run of it handles."""

    name: str
    count: int
    run: Callable[[], Any]


def check_installed(*packages: str) -> None:
    """Raises InputError where one of the packages of others, with whom a benchmark compares, is missing."""
    for package in packages:
        try:
            importlib.import_module(package)
        except ImportError as error:
            raise InputError(f"{package} is not installed; pip install 'biotac-lab[bench]'") from error


def timed(
    contestants: Sequence[Contestant], rounds: int, clock_ns: Callable[[], int] = time.perf_counter_ns
) -> dict[str, float]:
    """Median ns per frame or message, each timed right after an untimed run, which loads pages and caches."""
    times: dict[str, list[float]] = {contestant.name: [] for contestant in contestants}
    for _ in range(rounds):
        for contestant in contestants:
            contestant.run()
            start = clock_ns()
            contestant.run()
            times[contestant.name].append((clock_ns() - start) / contestant.count)
    return {name: statistics.median(ns) for name, ns in times.items()}


def tables(title: str, per: str, times: dict[str, float], best: dict[str, float], asked: Asked) -> list[Table]:
    """``times`` in ns, and the ratios of ``best``, the slower ones' times, to them."""
    ratios = [[fast, slow, best[slow] / times[fast], least, judge(best[slow] / times[fast], least)]
              for fast, slow, least in asked]  # fmt: skip
    return [
        Table(title, ["", f"median ns per {per}"], [[name, ns] for name, ns in times.items()], digits=1),
        Table(f"{title}: ratios", ["", "against", "times", "at least", ""], ratios, digits=1),
    ]


def judge(seen: float, least: float | None) -> str:
    """Whether a requirement of at least that is met, in words."""
    return "" if least is None else "met" if seen >= least else "NOT met"
